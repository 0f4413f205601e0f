"""Child processes: start them with a configuration on standard input, watch them, and always end them.

Each child is its own process group, so Ctrl-C reaches the parent alone. If that dies, their standard input ends, and
they leave (`gridpeers.wire.driver.process`).
"""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from time import monotonic

import msgspec

from gridpeers.scenarios.drivers.forking import ForkedProcess, ForkServer, ForkServerError
from gridpeers.wire.driver.process import BAD_CONFIG, BROKE, IN_ORDER, LEASH, OK
from gridpeers.wire.messages import PLANT

LAST_LINES = 12

GRACE = 2.0  # Time (s) for processes to leave after SIGTERM, the plant first

_FAULTS = {-signal.SIGSEGV, -signal.SIGBUS, -signal.SIGABRT, -signal.SIGFPE, -signal.SIGILL}
"""Exit statuses of faults in the code of the process itself; other signals come from outside."""

_IN_ORDER = {IN_ORDER + status: status for status in (OK, BAD_CONFIG, BROKE)}


class Child:
    """A started process, named after its inverter, or "plant"; its configuration goes to it as one line of JSON.

    `on_exit`, and `on_word` for every line of its standard output, are called from another thread. A server forks it;
    else it is a new interpreter.
    """

    def __init__(
        self,
        name: str,
        command: list[str],
        config: msgspec.Struct | tuple[msgspec.Struct, ...],
        log: Path,
        on_exit: Callable[[Child], None],
        on_word: Callable[[str], None] | None = None,
        server: ForkServer | None = None,
    ) -> None:
        self.name, self.log = name, log
        words = [*command, LEASH, name]  # the name is for people who look at ps
        with log.open("wb") as stderr:
            forked: ForkedProcess | None = None
            with contextlib.suppress(ForkServerError):
                forked = None if server is None else server.fork(words[1:], stderr, speaks=on_word is not None)
            self._process = forked or subprocess.Popen(
                # -P: a folder named like one of our packages, where the user stands, must not be imported instead
                [sys.executable, "-P", *words],
                stdin=subprocess.PIPE,
                stdout=stderr if on_word is None else subprocess.PIPE,
                stderr=stderr,
                start_new_session=True,
            )
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # it died at once; its exit is reported
            self._process.stdin.write(msgspec.json.encode(config) + b"\n")
            self._process.stdin.flush()
        self._watcher = threading.Thread(target=self._watch, args=(on_exit, on_word), daemon=True)
        self._watcher.start()

    def _watch(self, on_exit: Callable[[Child], None], on_word: Callable[[str], None] | None) -> None:
        if on_word is not None and self._process.stdout is not None:
            for line in self._process.stdout:
                on_word(line.decode(errors="replace").strip())
        self._process.wait()
        on_exit(self)

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def status(self) -> int | None:
        """Exit status, negative for a signal; None while it runs."""
        status = self._process.poll()
        return status if status is None else _IN_ORDER.get(status, status)

    @property
    def crashed(self) -> bool:
        """True if its own code ended it, for instance by a segmentation fault in a law, or by exit()."""
        status = self._process.poll()
        return status is not None and status not in _IN_ORDER and (status >= 0 or status in _FAULTS)

    def signal(self, number: int) -> None:
        self._process.send_signal(number)

    def join(self, until: float) -> bool:
        """Wait for its end until a time (s, monotonic); return False if it still runs."""
        self._watcher.join(max(0.0, until - monotonic()))
        return not self._watcher.is_alive()

    def release(self) -> None:
        """Close the pipes; a child that still runs then leaves."""
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with contextlib.suppress(BrokenPipeError):
                    pipe.close()

    @property
    def end(self) -> str:
        status = self.status
        if status is None:
            return "still runs"
        return f"was killed by {signal.Signals(-status).name}" if status < 0 else f"exited with status {status}"

    def report(self, when: str) -> str:
        """Return a sentence on how it ended, its last lines, and the path of the whole log."""
        lines = self.log.read_text(errors="replace").splitlines()[-LAST_LINES:]
        last = "".join(f"\n    {line}" for line in lines) or " none."
        return f"{self.name} {self.end} {when}. Its last lines:{last}\nWhole log: {self.log}"


class Children:
    """All processes of a run; `end` ends every one of them."""

    def __init__(self) -> None:
        self._children: list[Child] = []

    def __getitem__(self, name: str) -> Child:
        for child in reversed(self._children):
            if child.name == name:
                return child
        raise KeyError(name)

    def __iter__(self) -> Iterator[Child]:
        return iter(self._children)

    def lives(self, name: str) -> list[Child]:
        """Return all children of a name, the latest last."""
        return [child for child in self._children if child.name == name]

    def add(self, child: Child) -> None:
        self._children.append(child)

    def running(self) -> list[Child]:
        return [child for child in self._children if child.status is None]

    def wait(self, seconds: float) -> None:
        until = monotonic() + seconds
        for child in self.running():
            child.join(until)

    def end(self) -> None:
        """End all: ask, wait a short while, then kill. By process id, never by name."""
        try:
            # The plant first, and gone: an agent that is asked while its plant is there leaves the network.
            for of_plant in (True, False):
                asked = [child for child in self.running() if (child.name == PLANT) == of_plant]
                for child in asked:
                    child.signal(signal.SIGTERM)
                until = monotonic() + GRACE
                for child in asked:
                    child.join(until)
        finally:  # a second Ctrl-C shortens the wait and nothing else
            for child in self.running():
                child.signal(signal.SIGKILL)
            self.wait(GRACE)
            for child in self._children:
                child.release()
