"""A run in real time that is disturbed: what it does, what it uses, and what it says of it."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import msgspec
from msgspec.structs import replace

from gridpeers.scenarios.live.live_options import configure
from gridpeers.scenarios.schema import load_scenario
from tests.resources.attack import LINKED, Attack
from tests.toy.town import Town

MB = 1024.0
"""kB in a MB, as the kernel counts."""


def status_of(pid: int, name: str) -> float:
    """Return a size (MB) of a process by the kernel's name, e.g. VmRSS."""
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith(f"{name}:"):
            return float(line.split()[1]) / MB
    raise ValueError(f"process {pid} has no {name}")


def forget_peak(pid: int) -> None:
    """Begin to look for the highest memory of a process anew."""
    Path(f"/proc/{pid}/clear_refs").write_text("5")


class Memory(NamedTuple):
    """Resident memory of a process (MB)."""

    before: float
    peak: float
    after: float

    @property
    def growth(self) -> float:
        """Peak beside what it was before."""
        return self.peak / self.before


class MemoryWatch:
    """Memory of processes from now on."""

    def __init__(self, pids: Mapping[str, int]) -> None:
        self._pids = dict(pids)
        self._before = {name: status_of(pid, "VmRSS") for name, pid in self._pids.items()}
        for pid in self._pids.values():
            forget_peak(pid)

    def read(self) -> dict[str, Memory]:
        """Return the memory of each so far."""
        return {
            name: Memory(self._before[name], status_of(pid, "VmHWM"), status_of(pid, "VmRSS"))
            for name, pid in self._pids.items()
        }


def log_bytes(folder: Path) -> int:
    """Return the bytes of all logs in a folder."""
    return sum(path.stat().st_size for path in folder.rglob("*.log"))


PLANT_COMMAND = ("-m", "gridpeers.scenarios.emulation.emulated_plant")

DROP = re.compile(r": dropped a message on (\S+): (\w+) \(")
"""Key and kind in a line of a log."""

F_NOM, F_BAND = 60.0, 0.01
"""Hz."""

ROOT = Path(__file__).parents[2]


class Trial(NamedTuple):
    """What came of a disturbance."""

    rows: int
    """Rows of the plant while it lasted."""
    worst_step: float
    """Longest delay of a step of the whole run (s)."""
    late: int
    """Steps more than a control period late."""
    slipped: float
    """Time (s) by which the schedule was put off."""
    df: float
    """Largest deviation of a frequency while it lasted (Hz)."""
    df_after: float
    """The same in the last second."""
    rejected: int
    """Messages that plant and agents have counted as rejected meanwhile."""
    kinds: tuple[str, ...]
    """Kinds of rejection that logs name since the watch began."""
    log: int
    """Bytes of all logs written meanwhile."""
    memory: dict[str, Memory]
    """Of each process."""
    said: tuple[str, ...] = ()
    """Warnings of the plant."""

    @property
    def growth(self) -> float:
        """Largest growth of a process: its peak beside its memory before."""
        return max(memory.growth for memory in self.memory.values())

    @property
    def peak(self) -> float:
        """Largest peak of a process (MB)."""
        return max(memory.peak for memory in self.memory.values())


def real_town(folder: Path, name: str = "islanding", *, record: str = "physics") -> Town:
    """Return nine agents on the paper's feeder, islanded at 1 s and fully coordinated, in real time."""
    scenario, feeder = load_scenario(name)
    scenario = replace(scenario, events=scenario.events[:1])
    plant, agents = configure(scenario, feeder, "tcp/127.0.0.1:0", run="trial", case="IV")
    if record != "physics":
        plant = replace(plant, record=record)
        agents = tuple(replace(agent, record=record) for agent in agents)
    return Town(0, folder, configs=(plant, tuple(agents)), plant_command=PLANT_COMMAND)


class Watch:
    """A run before, during and after a disturbance."""

    def __init__(self, town: Town) -> None:
        self.town = town
        pids = {child.name: child.pid for child in town.children if child.status is None}
        self._rejected, self._log = self._count(), log_bytes(town.folder)
        self._said = {path.name: path.stat().st_size for path in town.folder.glob("*.log")}
        self._late, self._events = self._pace()[1], len(town.events)
        self.first_row = len(town.rows)
        self._memory = MemoryWatch(pids)

    def rejected(self) -> int:
        """Return the messages that plant and agents have rejected since this began to watch."""
        return self._count() - self._rejected

    def drops(self) -> set[tuple[str, str]]:
        """Return key and kind of the drops that logs name since this began to watch."""
        new = [path.read_bytes()[self._said.get(path.name, 0) :] for path in self.town.folder.glob("*.log")]
        return {(key, kind) for log in new for key, kind in DROP.findall(log.decode(errors="replace"))}

    def _count(self) -> int:
        """Return the messages that plant and agents have rejected so far."""
        answer = self.town.command("status")
        of_agents = sum(status.rejected for status in self.town.status.values())
        return of_agents + int(answer.data.get("rejected", 0))

    def _pace(self) -> tuple[float, int, float]:
        pacing = None if self.town.telemetry is None else self.town.telemetry.pacing
        return (0.0, 0, 0.0) if pacing is None else (pacing.worst, pacing.late, pacing.slipped)

    def run_on(self, seconds: float) -> None:
        """Wait until the run is so much further (s of run time)."""
        since = self.town.t
        self.town.until(
            lambda: self.town.t >= since + seconds, f"{seconds:g} s of run time", patience=60.0 + 4.0 * seconds
        )

    def df(self, rows: list[tuple[float, ...]]) -> float:
        """Return the largest deviation of a frequency (Hz) of an inverter that is on the network."""
        return max((abs(f - F_NOM) for row in rows for f in row[1::6] if f > 0.0), default=0.0)

    def result(self, rows: list[tuple[float, ...]]) -> Trial:
        """Return what came of it; `rows` are those of the time of the disturbance."""
        worst, late, slipped = self._pace()
        self.run_on(0.6)  # until every agent has sent its status once more
        return Trial(
            rows=len(rows),
            worst_step=worst,
            late=late - self._late,
            slipped=slipped,
            df=self.df(rows),
            df_after=self.df(self.town.rows[-50:]),
            rejected=self.rejected(),
            kinds=tuple(sorted({kind for _, kind in self.drops()})),
            log=log_bytes(self.town.folder) - self._log,
            memory=self._memory.read(),
            said=tuple(event.text for event in self.town.events[self._events :] if event.kind == "warning"),
        )


@contextmanager
def attacking(attack: Attack, folder: Path) -> Iterator[list[int]]:
    """Attack while in the context; the list has the number of messages that were sent, once it is left."""
    sent: list[int] = []
    log = (folder / "attacker.txt").open("w")
    words = [sys.executable, "-m", "tests.resources.attack"]
    process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log, text=True, cwd=ROOT)
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        process.stdin.write(msgspec.json.encode(attack).decode() + "\n")
        process.stdin.flush()
        assert process.stdout.readline().strip() == LINKED, (folder / "attacker.txt").read_text()
        yield sent
        process.stdin.close()
        sent.append(int(process.stdout.readline() or 0))
        process.wait(20.0)
    finally:
        process.kill()
        process.wait()
        for pipe in (process.stdin, process.stdout, log):
            pipe.close()


def attack_on(town: Town, kind: str, rate: float, *, size: int = 0, tokens: int = 0) -> Attack:
    """Return an attack on a run and all its agents."""
    names = tuple(town.plant_config.agents)
    epochs = {name: town.status[name].epoch for name in names}
    return Attack(
        endpoint=town.endpoint, run=town.plant_config.run, names=names, kind=kind, rate=rate, epochs=epochs, size=size,
        tokens=tokens, links=len(names) + 1,
    )  # fmt: skip


def attacked(
    town: Town, kind: str, rate: float, seconds: float, *, size: int = 0, tokens: int = 0
) -> tuple[Trial, int]:
    """Attack a run for so long (s of run time); return what came of it, and the number of messages sent."""
    watch = Watch(town)
    with attacking(attack_on(town, kind, rate, size=size, tokens=tokens), town.folder) as sent:
        begin = len(town.rows)
        watch.run_on(seconds)
        rows = town.rows[begin:]
    watch.run_on(1.0)
    town.together(town.plant_config.agents)
    return watch.result(rows), sum(sent)
