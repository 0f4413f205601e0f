"""How a process ends: by a signal, by the loss of its output, or although threads would keep it.

Output is lost when its reader has gone, as by `| head -3`, or its disk is full. SIGPIPE is ignored, because it would
also come of a Zenoh session or a child that disappears. So the write itself detects the loss, below all buffers:

- A command that exists for its output quits (`speaking`). If no reader is left, it ends silently with the exit
  status that a shell gives for SIGPIPE; if the output cannot be written, it ends with one line on standard error.
- A plant, an agent or a group of them continues, and its output, a log, is dropped: others depend on it.
"""

from __future__ import annotations

import atexit
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
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

SAME_REQUEST_TIME = 1.0
"""Time (s) in which further signals are the same request: `timeout` signals a command and then its group, and whoever
ends all processes of a run signals those that their parent ends too. An end must not be interrupted by that."""


def stop_handler(error: Callable[[str], BaseException]) -> Callable[[int, FrameType | None], None]:
    """Return a handler of signals: SIGINT raises KeyboardInterrupt, any other an error that is made from its name.

    A signal less than `SAME_REQUEST_TIME` after one that raised does nothing.
    """
    raised_at = -inf

    def stop(number: int, frame: FrameType | None) -> None:
        nonlocal raised_at
        now = monotonic()
        if now - raised_at >= SAME_REQUEST_TIME:
            raised_at = now
            name = signal.Signals(number).name
            raise KeyboardInterrupt(name) if number == signal.SIGINT else error(name)

    return stop


def stop_at_signals(error: Callable[[str], BaseException]) -> None:
    """Let SIGINT and SIGTERM raise in the main thread; a SIGINT that a background shell ignores stays ignored."""
    stop = stop_handler(error)
    signal.signal(signal.SIGTERM, stop)
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, stop)


READER_GONE = 128 + 13  # Exit status of a command whose reader has gone, as a shell counts SIGPIPE
UNWRITABLE = 2  # Exit status of a command whose output cannot be written, the same as for bad arguments


class OutputLostError(SystemExit):
    """End of a command whose output is lost; contexts exit as on any other end."""

    def __init__(self, status: int, text: str) -> None:
        super().__init__(status)
        self._text = text

    def __str__(self) -> str:
        return self._text


class _Watched(io.FileIO):
    """Standard output or error that detects its loss. A process that continues tries again: a disk may have space."""

    def __init__(self, stream: io.TextIOWrapper, *, quits: bool) -> None:
        super().__init__(stream.fileno(), "w", closefd=False)
        self.name = stream.name
        self.quits = quits
        self._raised = False

    def write(self, data: ReadableBuffer, /) -> int:
        try:
            if not self._raised:
                return super().write(data)
        except OSError as error:
            # In another thread the error would end only that thread. A command that cannot write its error message
            # still has its exit status.
            gone = isinstance(error, BrokenPipeError)
            ends = self.quits and (gone or self.name != "<stderr>")
            if ends and threading.current_thread() is threading.main_thread():
                self._raised = True  # once: the rest of the output is dropped
                if gone:
                    raise OutputLostError(READER_GONE, "nobody reads its output any more") from None
                text = f"standard output cannot be written: {error.strerror or error}"
                raise OutputLostError(UNWRITABLE, text) from None
        return memoryview(data).nbytes


@contextmanager
def speaking(program: str) -> Iterator[None]:
    """Run a command that exists for its output; end it by `OutputLostError` when the output is lost."""
    watch_readers(quits=True)
    try:
        try:
            yield
        finally:
            _flush()  # an error at the interpreter's own flush would print a traceback
    except OutputLostError as error:
        if error.code == UNWRITABLE:
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
        raw = getattr(stream.buffer, "raw", stream.buffer)  # python -u has no buffer between
        if isinstance(raw, _Watched):
            raw.quits = quits
        elif stream is getattr(sys, f"__{name}__"):
            stream.flush()
            watched = _Watched(stream, quits=quits)
            fresh = io.TextIOWrapper(
                watched if raw is stream.buffer else io.BufferedWriter(watched),
                encoding=stream.encoding,
                errors=stream.errors,
                line_buffering=stream.line_buffering,
                write_through=stream.write_through,
            )
            setattr(sys, name, fresh)


def _flush() -> None:
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOBase) and not stream.closed:
            stream.flush()


def leave(status: int) -> NoReturn:
    """End the process at once: neither a thread that a law has left nor the collection of garbage holds it up."""
    atexit._run_exitfuncs()  # noqa: SLF001  Python would do this once all threads had ended
    _flush()
    os._exit(status)
