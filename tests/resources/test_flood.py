"""Floods in a run of real processes: bounded memory and log, control goes on, and every loss is counted."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec

from gridpeers.wire.driver.session import Session
from gridpeers.wire.messages import LONGEST_MESSAGE
from tests.resources.attack import LINKED, Attack
from tests.toy.town import Town

ROOT = Path(__file__).parents[2]
TWO = ("inv1", "inv2")
DROP = re.compile(r": dropped a message on (\S+): (\w+) \(")


def memory(pid: int, name: str) -> int:
    """Return a size (kB) of a process by the kernel's name: VmRSS now, VmHWM at most."""
    found = re.search(rf"^{name}:\s+(\d+) kB", Path(f"/proc/{pid}/status").read_text(), re.MULTILINE)
    assert found is not None
    return int(found[1])


class Watch:
    """A run from now on."""

    def __init__(self, town: Town) -> None:
        self._town = town
        self._rejected = self._count()
        self._logs = {path: path.stat().st_size for path in town.folder.glob("*.log")}
        self._rows = len(town.rows)
        self._memory = {child.pid: memory(child.pid, "VmRSS") for child in town.children}
        for pid in self._memory:
            Path(f"/proc/{pid}/clear_refs").write_text("5")  # the highest size from now on

    def _count(self) -> int:
        of_agents = sum(status.rejected for status in self._town.status.values())
        return of_agents + int(self._town.command("status").data.get("rejected", 0))

    def rejected(self) -> int:
        """Return the messages that plant and agents have rejected since."""
        return self._count() - self._rejected

    def _said(self) -> bytes:
        return b"".join(path.read_bytes()[size:] for path, size in self._logs.items())

    def drops(self) -> set[tuple[str, str]]:
        """Return key and kind of the drops that logs name since."""
        return set(DROP.findall(self._said().decode(errors="replace")))

    def kinds(self) -> set[str]:
        return {kind for _, kind in self.drops()}

    def assert_bounded(self) -> None:
        """Memory has not doubled, the log has no line for each message, rows came, and nobody has ended."""
        since = self._town.t
        self._town.until(lambda: self._town.t >= since + 0.5, "half a second of the run", patience=60.0)
        for pid, before in self._memory.items():
            assert memory(pid, "VmHWM") < 2.0 * before
        assert len(self._said()) < 50_000
        assert len(self._town.rows) > self._rows
        assert [child.status for child in self._town.children] == [None] * 3


@contextmanager
def attacking(town: Town, kind: str) -> Iterator[Watch]:
    watch, attack = Watch(town), Attack(endpoint=town.endpoint, run=town.plant_config.run, names=TWO, kind=kind)
    words = [sys.executable, "-m", "tests.resources.attack"]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
        try:
            assert process.stdin is not None
            assert process.stdout is not None
            process.stdin.write(msgspec.json.encode(attack).decode() + "\n")
            process.stdin.flush()
            assert process.stdout.readline().strip() == LINKED
            yield watch
        finally:
            process.kill()
    watch.assert_bounded()


def test_floods_of_strangers_are_counted_and_control_goes_on(tmp_path: Path) -> None:
    """States, measurements, stops, questions, tokens, long messages of somebody: the run goes on, and says how many."""
    with Town(2, tmp_path).all() as town:
        with attacking(town, "commands") as watch:  # first: a log names the first of each kind
            unanswered = (town.keys.request, "excess")
            town.until(lambda: unanswered in watch.drops(), "the plant says that it answers no more")
        assert watch.rejected() > 0
        with attacking(town, "foreign") as watch:
            town.until(lambda: watch.rejected() > 3_000, "thousands are counted")
            town.until(lambda: abs(town.rows[-1][1] - 60.0) < 0.005, "the frequency is restored meanwhile")
            assert "corrupt" in watch.kinds()
        with attacking(town, "tokens") as watch:
            town.until(lambda: watch.rejected() > 400, "the plant and the agents have counted them")
        assert "excess" in watch.kinds()
        town.together(TWO)


def test_long_messages_of_a_stranger_are_counted(tmp_path: Path) -> None:
    """They are told once; a new session replaces one that Zenoh has broken."""
    with Town(2, tmp_path).all() as town:
        watch, someones, tries = Watch(town), list[Session](), 0

        def told() -> bool:
            nonlocal tries
            if tries % 100 == 0:
                for someone in someones:
                    someone.close()
                someones[:] = [
                    Session("someone", listen=("tcp/127.0.0.1:0",), connect=(town.endpoint,), clock="realtime")
                ]
            tries += 1
            for name in TWO:
                someones[0].publish(town.keys.state(name), bytes(LONGEST_MESSAGE + 1))
            return watch.rejected() >= 2 and "oversized" in watch.kinds()

        try:
            town.until(told, "the long ones are counted and told")
        finally:
            someones[0].close()
        watch.assert_bounded()
        town.together(TWO)
