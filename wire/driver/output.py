"""Output that gets nowhere: its reader has gone, as by `| head -3`, or its disk is full.

SIGPIPE ends a C program there. Python ignores it, and so must we: a Zenoh session or a child that goes away in the
middle of a write would end the process too. So the write itself finds out, below all that buffers: print, logging and
rich alike. What follows is one of two:

- A command that exists for its output quits (`speaking`). If nobody reads, it does so without a word and with the exit
  status that a shell gives for SIGPIPE; if it cannot be written, with one line on standard error. So does a relay: what
  it did to the network ends with it, and does not outlast the process that started it.
- A plant, an agent or a whole fleet goes on, and what it says is dropped. Its output is a log, and its work is to serve
  others. To leave as on SIGTERM would take an inverter off the network, or end the run for everybody, because somebody
  quit a pager: who wants that has `gridpeers stop`, `gridpeers down` and signals.
"""

from __future__ import annotations

import io
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

READER_GONE = 128 + getattr(signal, "SIGPIPE", 13)
"""Exit status of a command whose reader has gone, as a shell counts signals."""

UNWRITABLE = 2
"""Exit status of a command whose output the machine refuses, as of one whose arguments cannot be used."""


class OutputLostError(SystemExit):
    """What the command says gets nowhere, so it ends; contexts are left as on any other end."""


class ReaderGoneError(OutputLostError):
    """Nobody reads what the command says."""

    def __init__(self) -> None:
        super().__init__(READER_GONE)

    def __str__(self) -> str:
        return "nobody reads its output any more"


class UnwritableError(OutputLostError):
    """What the command says cannot be written, e.g. to a full disk."""

    def __init__(self, why: str) -> None:
        super().__init__(UNWRITABLE)
        self._why = why

    def __str__(self) -> str:
        return f"standard output cannot be written: {self._why}"


class _Watched(io.FileIO):
    """Standard output or error that notices when it gets nowhere; from then on, what a command says is dropped.

    Who goes on tries again: a disk may have space again, a reader that has gone never comes back.
    """

    def __init__(self, stream: io.TextIOWrapper, *, quits: bool) -> None:
        super().__init__(stream.fileno(), "w", closefd=False)
        self.name = stream.name
        self.quits = quits
        self._lost: OutputLostError | None = None
        self._told = False

    def write(self, data: ReadableBuffer, /) -> int:
        """Write what can be written."""
        if not isinstance(self._lost, ReaderGoneError) and not self._told:
            try:
                return super().write(data)
            except BrokenPipeError:
                self._lost = ReaderGoneError()
            except OSError as error:
                self._lost = UnwritableError(error.strerror or str(error))
        # Once is enough: what is said on the way out is dropped. In another thread it would end that thread alone.
        if self._ends() and not self._told and threading.current_thread() is threading.main_thread():
            self._told = True
            assert self._lost is not None
            raise self._lost
        return memoryview(data).nbytes

    def _ends(self) -> bool:
        """Whether it is a reason to quit; complaints that cannot be written keep their exit status, at least."""
        return self.quits and (isinstance(self._lost, ReaderGoneError) or self.name != "<stderr>")


@contextmanager
def speaking(program: str) -> Iterator[None]:
    """Run a command that exists for its output; it ends in order when that gets nowhere, by `OutputLostError`.

    Parameters
    ----------
    program : str
        Who says on standard error that standard output cannot be written.
    """
    watch_readers(quits=True)
    try:
        try:
            yield
        finally:
            _flush()  # what this does at the interpreter's own end would be a complaint
    except UnwritableError as error:
        print(f"{program}: {error}", file=sys.stderr)
        raise


def watch_readers(*, quits: bool) -> None:
    """Have standard output and error notice when they get nowhere; a later call changes what follows.

    Streams that are not the process's own, as those of tests, are left alone.

    Parameters
    ----------
    quits : bool
        Whether the process ends then, by `OutputLostError` in its main thread, or goes on in silence.
    """
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if not isinstance(stream, io.TextIOWrapper):  # closed from the beginning, or somebody else's
            continue
        binary = stream.buffer
        raw = getattr(binary, "raw", binary)  # python -u has no buffer between
        if isinstance(raw, _Watched):
            raw.quits = quits
        elif stream is getattr(sys, f"__{name}__"):
            stream.flush()
            watched = _Watched(stream, quits=quits)
            fresh = io.TextIOWrapper(
                watched if raw is binary else io.BufferedWriter(watched),
                encoding=stream.encoding,
                errors=stream.errors,
                line_buffering=stream.line_buffering,
                write_through=stream.write_through,
            )
            setattr(sys, name, fresh)


def _flush() -> None:
    """Write what is still buffered, while it can yet be noticed that it gets nowhere."""
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            stream.flush()
