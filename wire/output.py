"""Output that nobody reads any more: what becomes of a process when the pipe behind it is closed, as by `| head -3`.

SIGPIPE ends a C program there. Python ignores it, and so must we: a Zenoh session or a child that goes away in the
middle of a write would end the process too. So the write itself finds out, below all that buffers: print, logging and
rich alike. What follows is one of two:

- A command that exists for its output quits, without a word, with the exit status that a shell gives for SIGPIPE.
- A plant, an agent or a whole fleet goes on, and what it says is dropped. Its output is a log, and its work is to serve
  others. To leave as on SIGTERM would take an inverter off the network, or end the run for everybody, because somebody
  quit a pager: who wants that has `gridpeers stop`, `gridpeers down` and signals.
"""

from __future__ import annotations

import io
import signal
import sys
import threading
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

READER_GONE = 128 + getattr(signal, "SIGPIPE", 13)
"""Exit status of a command whose reader has gone, as a shell counts signals."""


class ReaderGoneError(SystemExit):
    """Nobody reads what the command says, so it ends; contexts are left as on any other end."""

    def __init__(self) -> None:
        super().__init__(READER_GONE)

    def __str__(self) -> str:
        return "nobody reads its output any more"


class _Watched(io.FileIO):
    """Standard output or error that notices when its reader has gone; from then on it writes nowhere."""

    def __init__(self, stream: io.TextIOWrapper, *, quits: bool) -> None:
        super().__init__(stream.fileno(), "w", closefd=False)
        self.name = stream.name
        self.quits = quits
        self._gone = self._told = False

    def write(self, data: ReadableBuffer, /) -> int:
        """Write what can be written."""
        if not self._gone:
            try:
                return super().write(data)
            except BrokenPipeError:
                self._gone = True
        # Once is enough: what is said on the way out is dropped. In another thread it would end that thread alone.
        if self.quits and not self._told and threading.current_thread() is threading.main_thread():
            self._told = True
            raise ReaderGoneError
        return memoryview(data).nbytes


def watch_readers(*, quits: bool) -> None:
    """Have standard output and error notice when their reader has gone; a later call changes what follows.

    Streams that are not the process's own, as those of tests, are left alone.

    Parameters
    ----------
    quits : bool
        Whether the process ends then, by `ReaderGoneError` in its main thread, or goes on in silence.
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


def flush() -> None:
    """Write what is still buffered, while it can yet be noticed that nobody reads it."""
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            stream.flush()
