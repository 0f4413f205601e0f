"""Processes that are forked instead of started anew: the client of `gridpeers.wire.driver.fork_server`."""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import json
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any

_SET_CHILD_SUBREAPER = 36  # Option of `prctl(2)`: orphans below this process become its children
AVAILABLE = sys.platform == "linux"  # True where forking works; elsewhere every process is started anew

PATIENCE = 15.0
"""Longest wait (s) for a new process. The plant's server imports for 1 s; if its step is cached for another processor,
it compiles for a minute without an answer."""


class ForkServerError(RuntimeError):
    """The fork server cannot fork; start the process anew."""


class ForkServer:
    """Fork processes of this one, from a server that has imported modules, or called the functions `module:function`.

    What it has forked goes on when it is closed. ForkServerError if this process cannot become a parent of forked ones.
    """

    def __init__(self, preload: Sequence[str]) -> None:
        libc = ctypes.CDLL(None, use_errno=True)
        if libc.prctl(_SET_CHILD_SUBREAPER, 1, 0, 0, 0):
            raise ForkServerError(f"this process cannot be a subreaper: {os.strerror(ctypes.get_errno())}")
        self._control, served = socket.socketpair()
        self._control.settimeout(PATIENCE)
        one_thread = {"OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}  # a server may have no other threads
        with served:
            self._server = subprocess.Popen(
                [sys.executable, "-P", "-m", "gridpeers.wire.driver.fork_server", str(served.fileno()), *preload],
                stdin=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,  # what cannot be imported is in the log of the process that is started anew
                pass_fds=(served.fileno(),),
                start_new_session=True,
                env=os.environ | one_thread,
            )

    @property
    def lives(self) -> bool:
        return self._server.poll() is None

    def fork(self, words: Sequence[str], log: IO[bytes], *, speaks: bool) -> ForkedProcess:
        """Run a module in a new process, which writes to `log`, or on its standard output to this process if it speaks.

        ForkServerError if the server cannot fork, or is gone.
        """
        reading, writing = os.pipe()
        hearing, speaking = os.pipe() if speaks else (-1, log.fileno())
        answer: dict[str, Any] = {"error": "the fork server is gone"}
        try:
            socket.send_fds(self._control, [json.dumps(list(words)).encode()], [reading, speaking, log.fileno()])
            if data := self._control.recv(4096):
                answer = json.loads(data)
        except OSError as error:
            self.close()  # what it forks now, nobody would know of
            answer = {"error": str(error)}
        finally:
            for end in (reading, speaking) if speaks else (reading,):
                os.close(end)
        stdin, stdout = os.fdopen(writing, "wb"), os.fdopen(hearing, "rb") if speaks else None
        if "pid" in answer:
            return ForkedProcess(answer["pid"], stdin, stdout)
        for pipe in filter(None, (stdin, stdout)):
            pipe.close()
        raise ForkServerError(answer["error"])

    def __enter__(self) -> ForkServer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self._control.close()
        self._server.kill()  # it may still import; it has nothing to put in order
        with contextlib.suppress(KeyboardInterrupt):  # another Ctrl-C, while the command ends
            self._server.wait()


class ForkedProcess:
    """A child that this process has not started itself, with the part of `subprocess.Popen` that its owner uses."""

    def __init__(self, pid: int, stdin: IO[bytes], stdout: IO[bytes] | None) -> None:
        self.pid, self.stdin, self.stdout = pid, stdin, stdout
        self._lock = threading.Lock()
        self.returncode: int | None = None

    def poll(self) -> int | None:
        with self._lock:
            if self.returncode is None:
                pid, status = os.waitpid(self.pid, os.WNOHANG)
                if pid:
                    self.returncode = os.waitstatus_to_exitcode(status)
            return self.returncode

    def wait(self) -> int:
        with contextlib.suppress(ChildProcessError):  # another thread has asked for its status meanwhile
            os.waitid(os.P_PID, self.pid, os.WEXITED | os.WNOWAIT)  # without the lock, and it stays for `poll`
        status = self.poll()
        assert status is not None
        return status

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, signal.Signals(number))


_OF_AGENTS = (
    "gridpeers.wire.driver.session:load_zenoh",
    "gridpeers.agents.agent_process",
    "gridpeers.agents.laws.consensus",
)

_OF_PLANTS = (
    *("gridpeers.wire.driver.session:load_zenoh", "gridpeers.plant.plant_process"),
    *("gridpeers.plant.build", "gridpeers.plant.build:load_kernels"),
)
"""Agents have another server, because they do not load numpy."""

_SET_BY_US = {"ZENOH_RUNTIME"}  # Variables that loading Zenoh sets in this process and in the server

_kept: dict[tuple[str, ...], ForkServer] = {}  # Servers by the modules that they have imported

_inherited: tuple[int, str, dict[str, str]] | None = None
"""Owner, folder and variables that these servers inherited; if they change, new servers start."""

_lock = threading.RLock()


def agent_server(module: str = "gridpeers.agents", *, start: bool = True) -> ForkServer | None:
    return _server((*_OF_AGENTS, module), start=start)


def plant_server() -> ForkServer | None:
    return _server(_OF_PLANTS)


def prepare() -> None:
    """Start the servers of a run with processes early, so that their imports are done when it begins."""
    plant_server()
    agent_server()


@atexit.register
def release() -> None:
    """End the servers of this process, before it ends, or runs for long and starts few others."""
    with _lock:
        if _inherited is not None and _inherited[0] == os.getpid():  # else they are of the process that forked this one
            for server in _kept.values():
                server.close()
        _kept.clear()


def _server(preload: tuple[str, ...], *, start: bool = True) -> ForkServer | None:
    """Return the server with these modules, started if so wished; None if there is none, or this system cannot fork."""
    global _inherited
    variables = {name: value for name, value in os.environ.items() if name not in _SET_BY_US}
    with _lock:
        try:
            now = os.getpid(), str(Path.cwd()), variables
            if now != _inherited:
                release()
                _inherited = now
            if start and AVAILABLE and not (preload in _kept and _kept[preload].lives):
                _kept[preload] = ForkServer(preload)
        except (ForkServerError, OSError):  # among others, the working directory has been deleted
            return None
        return _kept.get(preload)
