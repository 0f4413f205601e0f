"""How a process ends: by a signal, by the loss of its output, or at once.

Output is lost when its reader has gone, as by `| head -3`, or its disk is full. Python ignores SIGPIPE, and so must we:
a Zenoh session or a child that disappears in the middle of a write would end the process too. So the write itself
detects the loss, below all buffers, for print, logging and rich alike. There are two reactions:

- A command that exists for its output quits (`speaking`). If no reader is left, it ends silently with the exit
  status that a shell gives for SIGPIPE; if the output cannot be written, it ends with one line on standard error.
- A plant, an agent or a group of them continues, and its output, a log, is dropped: others depend on it.
"""

from __future__ import annotations

import atexit
import gc
import io
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import inf
from time import monotonic
from types import FrameType
from typing import TYPE_CHECKING, BinaryIO

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

SAME_REQUEST_TIME = 1.0
"""Time (s) in which further signals are the same request: `timeout` signals a command and then its group, and whoever
ends all processes of a run signals those that their parent ends too. An end must not be interrupted by that."""

Error = Callable[[str], BaseException]
"""Makes the error that a signal raises, from its name."""


class StopSignal:
    """Handler of signals, for `signal.signal`."""

    def __init__(self, error: Error, clock: Callable[[], float] = monotonic) -> None:
        self._error, self._clock = error, clock
        self._at = -inf
        self.requests = 0
        """Number of requests so far."""

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Raise the error, unless it was raised less than `SAME_REQUEST_TIME` ago."""
        now = self._clock()
        if now - self._at >= SAME_REQUEST_TIME:
            self._at = now
            self.requests += 1
            raise self._error(signal.Signals(number).name)


def ctrl_c_or(error: Error) -> Error:
    """Return what makes KeyboardInterrupt of SIGINT, and another error of any other signal."""
    return lambda name: KeyboardInterrupt(name) if name == signal.SIGINT.name else error(name)


def stop_at_signals(error: Error) -> StopSignal:
    """Have SIGINT raise KeyboardInterrupt in the main thread and SIGTERM another error; return their handler.

    A SIGINT that is ignored stays so: a shell ignores that of a program in the background.
    """
    stop = StopSignal(ctrl_c_or(error))
    signal.signal(signal.SIGTERM, stop)
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, stop)
    return stop


READER_GONE = 128 + getattr(signal, "SIGPIPE", 13)
"""Exit status of a command whose reader has gone, as a shell counts signals."""

UNWRITABLE = 2
"""Exit status of a command whose output cannot be written, the same as for bad arguments."""


class OutputLostError(SystemExit):
    """End of a command whose output is lost; contexts exit as on any other end."""

    def __init__(self, status: int, text: str) -> None:
        super().__init__(status)
        self._text = text

    def __str__(self) -> str:
        return self._text


class ReaderGoneError(OutputLostError):
    """The reader of the output has gone."""

    def __init__(self) -> None:
        super().__init__(READER_GONE, "nobody reads its output any more")


class UnwritableError(OutputLostError):
    """The output cannot be written, e.g. to a full disk."""

    def __init__(self, why: str) -> None:
        super().__init__(UNWRITABLE, f"standard output cannot be written: {why}")


class _Unclosed(io.IOBase):
    """A layer of standard output or error that stays open when anybody closes it, and writes its buffer instead."""

    def close(self) -> None:
        """Write the buffer."""
        self.flush()


class _Text(_Unclosed, io.TextIOWrapper):
    """The outermost layer, for text."""

    def detach(self) -> BinaryIO:
        """Raise `UnsupportedOperation`: without the layers below, nothing could be printed any more."""
        raise io.UnsupportedOperation("standard output and error stay as they are; write to their .buffer")


class _Buffer(_Unclosed, io.BufferedWriter):
    """The layer between."""


class _Watched(_Unclosed, io.FileIO):
    """Standard output or error that detects its loss; from then on, a command's output is dropped.

    A process that continues tries again: a disk may have space again, but a reader never comes back.
    """

    def __init__(self, stream: io.TextIOWrapper, *, quits: bool) -> None:
        super().__init__(stream.fileno(), "w", closefd=False)
        self.name = stream.name
        self.quits = quits
        self._lost: OutputLostError | None = None
        self._raised = False

    def write(self, data: ReadableBuffer, /) -> int:
        """Write, or drop the data if the output is lost."""
        if not isinstance(self._lost, ReaderGoneError) and not self._raised:
            try:
                return super().write(data)
            except BrokenPipeError:
                self._lost = ReaderGoneError()
            except OSError as error:
                self._lost = UnwritableError(error.strerror or str(error))
        # Raise once: the rest of the output is dropped. In another thread the error would end only that thread.
        if self._ends() and not self._raised and threading.current_thread() is threading.main_thread():
            self._raised = True
            assert self._lost is not None
            raise self._lost
        return memoryview(data).nbytes

    def _ends(self) -> bool:
        """Whether the process quits; a command that cannot write its error message still has its exit status."""
        return self.quits and (isinstance(self._lost, ReaderGoneError) or self.name != "<stderr>")


@contextmanager
def speaking(program: str) -> Iterator[None]:
    """Run a command that exists for its output; end it by `OutputLostError` when the output is lost."""
    watch_readers(quits=True)
    try:
        try:
            yield
        finally:
            flush_output()  # an error at the interpreter's own flush would print a traceback
    except UnwritableError as error:
        print(f"{program}: {error}", file=sys.stderr)
        raise


def watch_readers(*, quits: bool) -> None:
    """Let standard output and error detect their loss; a later call changes the reaction.

    If a process quits, it ends by `OutputLostError` in its main thread; else it continues silently.

    Streams that are not the process's own, such as those of tests, stay as they are.
    """
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if not isinstance(stream, io.TextIOWrapper):  # closed from the beginning, or replaced
            continue
        binary = stream.buffer
        raw = getattr(binary, "raw", binary)  # python -u has no buffer between
        if isinstance(raw, _Watched):
            raw.quits = quits
        elif stream is getattr(sys, f"__{name}__"):
            stream.flush()
            watched = _Watched(stream, quits=quits)
            fresh = _Text(
                watched if raw is binary else _Buffer(watched),
                encoding=stream.encoding,
                errors=stream.errors,
                line_buffering=stream.line_buffering,
                write_through=stream.write_through,
            )
            setattr(sys, name, fresh)


def flush_output() -> None:
    """Write all buffers, while their loss can still be detected; a stream that is closed or none has none."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOBase) and not stream.closed:
            stream.flush()


GRACE = 1.0
"""Time (s) for such threads to end by themselves."""


def leave(status: int, tell: Callable[[str], None]) -> None:
    """Return if no thread keeps the process alive, for Python to end; else end the process."""
    gc.freeze()  # Python would seek garbage twice at its end: 0.2 s of a command, and 20 ms of each agent
    deadline = monotonic() + GRACE
    own = (threading.main_thread(), threading.current_thread())
    left = [thread for thread in threading.enumerate() if not thread.daemon and thread not in own]
    for thread in left:
        thread.join(max(0.0, deadline - monotonic()))
    if still := [thread.name for thread in left if thread.is_alive()]:
        tell(f"ended although threads still ran that were started in it: {', '.join(still)}; make them daemons")
        atexit._run_exitfuncs()  # noqa: SLF001  Python would do this once they had ended
        flush_output()
        os._exit(status)
