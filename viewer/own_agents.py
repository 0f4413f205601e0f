"""Agents that a page has started: processes of their own, which leave when the page's server ends."""

from __future__ import annotations

import signal
import subprocess
import sys
import tempfile
from typing import IO

from gridpeers.scenarios.live.run_address import RunAddress, UsageError, check_name

LEAVING = 5.0
"""Time (s) that an agent has to leave by itself."""


class OwnAgents:
    """Start agents as `gridpeers agent` does in a terminal, and end them.

    Parameters
    ----------
    where : RunAddress
        The run.
    """

    def __init__(self, where: RunAddress) -> None:
        self._where = where
        self._started: dict[str, tuple[subprocess.Popen[bytes], IO[bytes]]] = {}

    def start(self, name: str) -> str:
        """Start an agent; return a sentence.

        Raises
        ------
        UsageError
            If one of that name that was started here still runs.
        """
        check_name("INVERTER", name)
        self.take_endings()
        if name in self._started:
            raise UsageError(f"{name}: its agent was started here already, process {self._started[name][0].pid}")
        log = tempfile.TemporaryFile()  # noqa: SIM115  closed with its process
        words = ["agent", name, *self._where.words]
        command = [sys.executable, "-P", "-m", "gridpeers", *words]
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT, start_new_session=True
        )
        self._started[name] = process, log
        return f"{name}: its agent starts, process {process.pid}; it leaves when this view ends"

    def take_endings(self) -> list[str]:
        """Return a sentence for each agent that has ended by itself since the last call."""
        endings = []
        for name, (process, log) in list(self._started.items()):
            if process.poll() is None:
                continue
            log.seek(0)
            lines = log.read()[-2000:].decode(errors="replace").strip().splitlines()
            log.close()
            del self._started[name]
            if process.returncode:
                endings.append(f"{name}: its agent ended, exit code {process.returncode}: {lines[-1] if lines else ''}")
        return endings

    def close(self) -> None:
        """Let all leave; end those that do not."""
        for process, _ in self._started.values():
            process.send_signal(signal.SIGTERM)
        for process, log in self._started.values():
            try:
                process.wait(LEAVING)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            log.close()
        self._started.clear()
