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
from collections.abc import Mapping, Sequence
from pathlib import Path
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
        with contextlib.suppress(ChildProcessError):  # another thread has asked for its status meanwhile
            os.waitid(os.P_PID, self.pid, os.WEXITED | os.WNOWAIT)  # without the lock, and it stays for `poll`
        status = self.poll()
        assert status is not None
        return status

    def send_signal(self, number: int) -> None:
        """Send a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, signal.Signals(number))


_OF_AGENTS = (
    "gridpeers.wire.driver.session:load_zenoh",
    "gridpeers.agents.agent_process",
    "gridpeers.agents.laws.consensus",
)
"""Modules, and a function to call, that the fork server loads once for all agents."""

_OF_PLANTS = (
    *("gridpeers.wire.driver.session:load_zenoh", "gridpeers.plant.plant_process"),
    *("gridpeers.plant.build", "gridpeers.plant.build:load_kernels"),
)
"""The same for plants. Agents have another server, because they do not load numpy."""

_OF_FIGURES = ("gridpeers.scenarios.results.plots.drawing_process",)
"""The same for processes that draw."""

_ONE_BLAS_THREAD = {"OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
"""A server may have no other threads, and the plant uses one anyway."""


_SET_BY_US = {"ZENOH_RUNTIME", "KMP_DUPLICATE_LIB_OK"}
"""Variables that loading Zenoh, and threadpoolctl, sets here as it does there."""


_kept: dict[tuple[str, ...], tuple[tuple[int, Path, dict[str, str]], ForkServer]] = {}
"""By modules: what the server has inherited (owner, folder, variables; once it differs, another is needed), and it."""


def agent_server(module: str = "gridpeers.agents", *, start: bool = True) -> ForkServer | None:
    """Return the server that forks agents, and start it if it is worth it; None where there is none."""
    preload = *_OF_AGENTS, module
    return _kept_server(preload) if start or preload in _kept else None


def plant_server() -> ForkServer | None:
    """Return the server that forks plants, and start it if there is none; None where this system cannot fork so."""
    return _kept_server(_OF_PLANTS, _ONE_BLAS_THREAD)


def figure_server(*, start: bool = True) -> ForkServer | None:
    """Return the server that forks processes that draw; if there is none, start it if so wished, else return None."""
    return _kept_server(_OF_FIGURES, _ONE_BLAS_THREAD) if start or _OF_FIGURES in _kept else None


def prepare() -> None:
    """Start the servers of a run with processes, so that they have imported once it begins."""
    plant_server()
    agent_server()


def release() -> None:
    """End the servers: for a process that goes on for long and starts few others from now on."""
    _close_all(os.getpid())


def _kept_server(preload: tuple[str, ...], environment: Mapping[str, str] = MappingProxyType({})) -> ForkServer | None:
    """Return the server with these modules, and start it if there is none; parameters are those of `ForkServer`."""
    if not AVAILABLE:
        return None
    variables = {name: value for name, value in os.environ.items() if name not in _SET_BY_US}
    try:
        surroundings = os.getpid(), Path.cwd(), variables
    except OSError:  # the working directory has been deleted
        return None
    if preload in _kept:
        before, server = _kept[preload]
        if before == surroundings and server.lives:
            return server
        del _kept[preload]
        if before[0] == surroundings[0]:  # else it is the server of the process that has forked this one
            server.close()
    try:
        server = ForkServer(preload, environment)
    except (ForkServerError, OSError):
        return None
    if not _kept:
        atexit.unregister(_close_all)
        atexit.register(_close_all, os.getpid())
    _kept[preload] = surroundings, server
    return server


def _close_all(owner: int) -> None:
    """End all servers at the end of the process that owns them."""
    while _kept and os.getpid() == owner:
        _kept.popitem()[1][1].close()
