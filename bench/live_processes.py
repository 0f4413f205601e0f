"""The processes of a live run as a user starts them: commands of gridpeers, each with a log."""

from __future__ import annotations

import signal
import subprocess
from pathlib import Path
from types import TracebackType
from typing import Self

from bench.harness import GRIDPEERS
from scenarios.drivers.free_endpoint import free_endpoint
from scenarios.live.client.run_address import RunAddress

BUILD = 300.0
"""Longest wait (s) for a run to begin: the plant may be compiled first."""

END = 20.0
"""Longest wait (s) for a process that was asked to end."""


class LiveProcesses:
    """The processes of one run. Use it as a context: none is left.

    Each is in a session of its own: the Ctrl-C of a terminal reaches the bench alone, which ends them.

    Parameters
    ----------
    folder : Path
        For the logs; the processes work there.
    run : str
        Name of the run.
    """

    def __init__(self, folder: Path, run: str) -> None:
        endpoint = free_endpoint()
        self.folder = folder
        self.address = RunAddress(run=run, connect=(endpoint,))
        """Where clients find the run."""
        self.listen = ["--run", run, "--listen", endpoint]
        """Options of the command that has the plant."""
        self.connect = ["--run", run, "--connect", endpoint]
        """Options of all other commands."""
        self._children: list[subprocess.Popen[bytes]] = []

    def start(self, name: str, *words: str) -> subprocess.Popen[bytes]:
        """Start a command by its words; what it prints is in `printed(name)`."""
        with self._log(name).open("wb") as log:
            child = subprocess.Popen(
                [*GRIDPEERS, *words], stdout=log, stderr=log, cwd=self.folder, start_new_session=True
            )
        self._children.append(child)
        return child

    def printed(self, name: str) -> str:
        """Return what the command of this name has printed so far."""
        return self._log(name).read_text(errors="replace")

    def _log(self, name: str) -> Path:
        return self.folder / f"{name}.log"

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End all processes that still run."""
        running = [child for child in self._children if child.poll() is None]
        for child in running:
            child.send_signal(signal.SIGCONT)  # a frozen one would not end
            child.send_signal(signal.SIGTERM)
        for child in running:
            try:
                child.wait(END)
            except subprocess.TimeoutExpired:
                child.kill()
                child.wait()
