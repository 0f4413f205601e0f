"""Processes that are forked instead of started anew: the client of `gridpeers.wire.driver.fork_server`."""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from types import MappingProxyType, TracebackType
from typing import IO, Any

_SET_CHILD_SUBREAPER = 36
"""Option of `prctl(2)`: orphans below this process become its children."""

AVAILABLE = sys.platform == "linux"
"""Whether this system has what forking needs; elsewhere every process is started anew."""


PATIENCE = 15.0
"""Longest wait (s) for a new process: the plant's server imports for 1 s, but where its step is cached for another
processor it would compile for a minute, without a word and deaf to Ctrl-C."""


class ForkServerError(RuntimeError):
    """A fork server that cannot fork; start the process anew."""


class ForkServer:
    """Fork processes of this one, from a server that has imported modules, or called the functions `module:function`.

    What it has forked goes on when it is closed, and has its environment too. ForkServerError if this process cannot
    become the parent of what the server forks.
    """

    def __init__(self, preload: Sequence[str], environment: Mapping[str, str] = MappingProxyType({})) -> None:
        libc = ctypes.CDLL(None, use_errno=True)
        if libc.prctl(_SET_CHILD_SUBREAPER, 1, 0, 0, 0):
            raise ForkServerError(f"this process cannot be a subreaper: {os.strerror(ctypes.get_errno())}")
        self._control, served = socket.socketpair()
        self._control.settimeout(PATIENCE)
        with served:
            self._server = subprocess.Popen(
                [sys.executable, "-P", "-m", "gridpeers.wire.driver.fork_server", str(served.fileno()), *preload],
                stdin=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,  # what cannot be imported is in the log of the process that is started anew
                pass_fds=(served.fileno(),),
                start_new_session=True,
                env=os.environ | environment,
            )

    @property
    def lives(self) -> bool:
        """Whether it has not ended."""
        return self._server.poll() is None

    def fork(self, words: Sequence[str], log: IO[bytes], *, speaks: bool) -> ForkedProcess:
        """Run a module in a new process, which writes to `log`, or on its standard output to this process if it speaks.

        ForkServerError if the server cannot fork, or is gone.
        """
        reading, writing = os.pipe()
        spoken = os.pipe() if speaks else None
        output = log.fileno() if spoken is None else spoken[1]
        try:
            socket.send_fds(self._control, [json.dumps(list(words)).encode()], [reading, output, log.fileno()])
            answer = self._control.recv(4096)
        except OSError as error:
            self.close()  # what it forks now, nobody would know of
            answer = json.dumps({"error": str(error)}).encode()
        finally:
            os.close(reading)
            if spoken is not None:
                os.close(spoken[1])
        told: dict[str, Any] = json.loads(answer) if answer else {"error": "the fork server is gone"}
        if "pid" not in told:
            os.close(writing)
            if spoken is not None:
                os.close(spoken[0])
            raise ForkServerError(told["error"])
        heard = None if spoken is None else os.fdopen(spoken[0], "rb")
        return ForkedProcess(told["pid"], os.fdopen(writing, "wb"), heard)

    def __enter__(self) -> ForkServer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the server."""
        self._control.close()
        self._server.kill()  # it may still import; it has nothing to put in order
        self._server.wait()


class ForkedProcess:
    """A child that this process has not started itself, with the part of `subprocess.Popen` that its owner uses."""

    def __init__(self, pid: int, stdin: IO[bytes], stdout: IO[bytes] | None) -> None:
        self.pid, self.stdin, self.stdout = pid, stdin, stdout
        self._lock = threading.Lock()
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """Return the exit status, negative for a signal; None while it runs."""
        with self._lock:
            if self.returncode is None:
                pid, status = os.waitpid(self.pid, os.WNOHANG)
                if pid:
                    self.returncode = os.waitstatus_to_exitcode(status)
            return self.returncode

    def wait(self) -> int:
        """Wait for its end; return the exit status."""
        with contextlib.suppress(ChildProcessError):  # another thread has asked for its status meanwhile
            os.waitid(os.P_PID, self.pid, os.WEXITED | os.WNOWAIT)  # without the lock, and it stays for `poll`
        status = self.poll()
        assert status is not None
        return status

    def send_signal(self, number: int) -> None:
        """Send a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, signal.Signals(number))
