"""Terminals of a test: commands as a user starts them, their output awaited with a deadline, and all of them ended."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Iterable, Sequence
from pathlib import Path
from time import monotonic, sleep
from types import TracebackType

from tests.command_line import invoke

DEADLINE = 80.0  # Longest wait (s) for any line, of a command that runs; on an idle machine all come within 3 s


class Terminal:
    """One command in a terminal of its own."""

    def __init__(self, words: Sequence[str], folder: Path, prefix: Sequence[str] = ()) -> None:
        self.words = list(words)
        command = [*prefix, sys.executable, "-P", "-c", "from gridpeers.cli.app import main; main()", *words]
        self._process = subprocess.Popen(
            command,
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
            env={**os.environ, "PYTHONUNBUFFERED": "1", "COLUMNS": "160"},
        )
        self.lines: list[str] = []
        self._seen = 0
        self._news = threading.Condition()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def text(self) -> str:
        return "".join(self.lines)

    def expect(self, pattern: str, deadline: float = DEADLINE) -> re.Match[str]:
        """Wait for a line that matches, among those not seen by an earlier call."""
        end = monotonic() + deadline
        with self._news:
            while True:
                while self._seen < len(self.lines):
                    line = self.lines[self._seen]
                    self._seen += 1
                    match = re.search(pattern, line)
                    if match is not None:
                        return match
                over = not self._reader.is_alive()
                if over or not self._news.wait(end - monotonic()):
                    why = "it has ended" if over else f"not within {deadline:g} s"
                    raise AssertionError(f"{self}: no line with {pattern!r}: {why}. It printed:\n{self.text}")

    def shows(self, text: str, deadline: float = DEADLINE) -> None:
        """Wait until a text stands anywhere in what it has printed."""
        end = monotonic() + deadline
        with self._news:
            while text not in self.text:
                waits = self._reader.is_alive() and self._news.wait(end - monotonic())
                assert waits or text in self.text, f"{self}: no {text!r}. It printed:\n{self.text}"

    def signal(self, number: int) -> None:
        self._process.send_signal(number)

    def end(self, deadline: float = DEADLINE) -> int:
        """Wait for its end; its exit status."""
        try:
            status = self._process.wait(deadline)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"{self}: still runs after {deadline:g} s. It printed:\n{self.text}") from None
        self._reader.join(deadline)
        return status

    def kill(self) -> None:
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGCONT)
            self._process.send_signal(signal.SIGTERM)
            try:
                self._process.wait(5.0)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait(5.0)
        self._reader.join(5.0)
        assert self._process.stdout is not None
        self._process.stdout.close()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            with self._news:
                self.lines.append(line)
                self._news.notify_all()
        with self._news:
            self._news.notify_all()

    def __str__(self) -> str:
        return "gridpeers " + " ".join(self.words)


class Desk:
    """All terminals of a test; leaving the context ends every one of them."""

    def __init__(self, folder: Path, *options: str) -> None:
        self.folder, self.options = folder, options
        self._terminals: list[Terminal] = []

    def __enter__(self) -> Desk:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for terminal in reversed(self._terminals):
            terminal.kill()

    def open(self, *words: str, prefix: Sequence[str] = ()) -> Terminal:
        """Start a command in a new terminal, with the options of the desk."""
        return self.open_bare(*words, *self.options, prefix=prefix)

    def open_bare(self, *words: str, prefix: Sequence[str] = ()) -> Terminal:
        """Start a command without the options of the desk."""
        terminal = Terminal(words, self.folder, prefix)
        self._terminals.append(terminal)
        return terminal

    def type(self, *words: str) -> tuple[int, str]:
        """Run a command to its end, in this process so that none need start; its exit status and what it printed."""
        return invoke(*words, *self.options, "--wait", f"{DEADLINE:g}")


def wait_for(file: Path, text: str) -> None:
    """Wait until a file, as a log, has a text in it."""
    end = monotonic() + DEADLINE
    while not (file.exists() and text in file.read_text()):
        assert monotonic() < end, f"{file} has no {text!r}"
        sleep(0.02)


def wait_for_the_end_of(pids: Iterable[int]) -> None:
    """Wait until processes have ended; a fork server ends just after its command, and nobody may reap it."""
    end = monotonic() + DEADLINE
    while left := [pid for pid in pids if _runs(pid)]:
        assert monotonic() < end, f"{left} still run"
        sleep(0.02)


def _runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def children_of(pid: int) -> list[int]:
    """Processes that the main thread of one has started."""
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
