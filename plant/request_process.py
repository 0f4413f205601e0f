"""A program in a process of its own that answers requests, one JSON object a line."""

from __future__ import annotations

import contextlib
import json
import os
import selectors
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from time import monotonic
from types import MappingProxyType
from typing import Any


def no_room(what: str, reason: str) -> str:
    """Return words for something that a process cannot write into the system's temporary folder."""
    remedy = "make room there, raise the limit of file sizes (ulimit -f), or set TMPDIR to another folder"
    return f"{what} cannot be written in {tempfile.gettempdir()} ({reason}); {remedy}"


ROOT = str(Path(__file__).parents[2])  # folder of our packages


def program(module: str, *arguments: str) -> list[str]:
    """Return the command that runs `main` of a module of ours, wherever this process has found our packages.

    It has one BLAS thread: our matrices are small, and a process with one thread can be forked at any time.
    """
    run = "import os, sys; os.environ.setdefault('OPENBLAS_NUM_THREADS', '1'); "
    run += f"sys.path.insert(0, {ROOT!r}); from {module} import main; main()"
    return [sys.executable, "-P", "-c", run, *arguments]


class ProcessEndedError(RuntimeError):
    pass


class RequestProcess:
    """A program with requests on standard input and answers on standard output; its standard error is kept.

    `folder`: its working folder, by default this process's; `environment`: variables beside those of this process.
    """

    def __init__(
        self, command: Sequence[str], folder: Path | None = None, environment: Mapping[str, str] = MappingProxyType({})
    ) -> None:
        self._unread = b""
        self._log = tempfile.TemporaryFile()  # noqa: SIM115  closed with the process
        try:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._log,
                cwd=folder,
                env=os.environ | environment,
                start_new_session=True,  # Ctrl-C is for the run, which then ends this process in order
            )
        except OSError:
            self._log.close()
            raise
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._requests, self._answers = self._process.stdin, self._process.stdout
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._answers, selectors.EVENT_READ)

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def closed(self) -> bool:
        return self._log.closed

    def send(self, request: Mapping[str, Any]) -> None:
        """Send a request; if the process has ended, `answer` says so."""
        with contextlib.suppress(OSError):
            self._requests.write(json.dumps(request).encode() + b"\n")
            self._requests.flush()

    def answer(self, until: float) -> dict[str, Any] | None:
        """Return the next answer, None without one by a time of `monotonic` (s); ProcessEndedError if it has ended."""
        while b"\n" not in self._unread:
            if not self._selector.select(max(0.0, until - monotonic())):
                return None
            piece = os.read(self._answers.fileno(), 1 << 20)
            if not piece:
                status = self._process.wait()
                how = f"was killed by {signal.Signals(-status).name}" if status < 0 else f"exited with status {status}"
                raise ProcessEndedError(how)
            self._unread += piece
        line, _, self._unread = self._unread.partition(b"\n")
        answer: dict[str, Any] = json.loads(line)
        return answer

    def printed(self) -> str:
        return os.pread(self._log.fileno(), os.fstat(self._log.fileno()).st_size, 0).decode(errors="replace")

    def close(self, patience: float = 0.0) -> None:
        """End the process, after waiting so long (s) for its own end; it may be called again."""
        if self.closed:
            return
        try:
            self._process.wait(patience)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._selector.close()
        for stream in (self._requests, self._answers, self._log):
            with contextlib.suppress(BrokenPipeError):  # a request that it never read
                stream.close()
