"""Runs of the drivers as tests want them: rows in a list, children remembered, first differences shown."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.netem.ledger import LinkTrace
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.scenarios.drivers.children import Child, Children
from gridpeers.scenarios.drivers.process_driver import run_processes
from gridpeers.scenarios.results.link_record import LinkRecord
from gridpeers.scenarios.run_request import Outcome
from gridpeers.wire.messages import PlantEvent, Telemetry
from tests.toy import toy_plant

TOY = (toy_plant.__file__,)  # Command of the toy plant's process

Rows = list[tuple[float, ...]]
COLUMNS = ("f (Hz)", "P (W)", "Q (var)", "V (V)", "P_set (W)", "V_set (V)")


class ProcessRun:
    """One run with processes."""

    def __init__(self, plant: PlantConfig, agents: Sequence[AgentConfig], log_dir: Path) -> None:
        self.plant, self.agents, self.log_dir = plant, agents, log_dir
        self.rows: Rows = []
        self.events: list[PlantEvent] = []
        self.children: Children | None = None
        self.pids: list[int] = []
        self._at: list[tuple[float, Callable[[], None]]] = []
        self._steps: list[tuple[Callable[[], bool], Callable[[], None]]] = []

    def once(self, condition: Callable[[], bool], do: Callable[[], None]) -> None:
        """Do something as soon as a condition on rows and events holds, after what earlier calls of this do."""
        self._steps.append((condition, do))

    def time_of(self, text: str) -> float:
        """Run time (s) of the last event with a text in it; infinite if there is none."""
        return next((event.t for event in reversed(self.events) if text in event.text), float("inf"))

    def at(self, t: float, do: Callable[[], None]) -> None:
        """Do something as soon as telemetry of t (s) or later is in."""
        self._at.append((t, do))

    def child(self, name: str) -> Child:
        assert self.children is not None
        return self.children[name]

    def __call__(self, **more: Any) -> Outcome:
        """Run; afterwards no process is left."""
        try:
            outcome = run_processes(
                self.plant,
                self.agents,
                self.log_dir,
                self._take,
                on_start=self._started,
                **{"plant_command": TOY} | more,
            )
            assert self._steps == [], f"{len(self._steps)} steps were not reached; {outcome}"
            return outcome
        finally:
            later = [] if self.children is None else [child.pid for child in self.children]
            assert [pid for pid in {*self.pids, *later} if exists(pid)] == []

    def _started(self, children: Children) -> None:
        self.children = children
        self.pids = [child.pid for child in children]

    def _take(self, telemetry: Telemetry) -> None:
        self.rows += telemetry.rows
        self.events += telemetry.events
        due = [do for t, do in self._at if telemetry.t >= t]
        self._at = [(t, do) for t, do in self._at if telemetry.t < t]
        for do in due:
            do()
        while self._steps and self._steps[0][0]():
            self._steps.pop(0)[1]()


def exists(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def first_difference(expected: Rows, got: Rows) -> str:
    """The first row in which two runs differ, column by column; empty if none does."""
    for a, b in zip(expected, got, strict=False):
        if a != b:
            names = ["t (s)", *(f"inv{i + 1} {column}" for i in range(len(a) // 6) for column in COLUMNS)]
            pairs = [f"{n}: {x!r} != {y!r}" for n, x, y in zip(names, a, b, strict=True) if x != y]
            return f"first difference at t = {a[0]:g} s: " + ", ".join(pairs[:6])
    return "" if len(expected) == len(got) else f"{len(expected)} rows, but {len(got)}"


def by_link(record: LinkRecord) -> dict[tuple[str, str], LinkTrace]:
    found: dict[tuple[str, str], LinkTrace] = {}
    for part in record.traces:
        link = part.src, part.dst
        one = found.get(link, LinkTrace(*link, (), (), ()))
        found[link] = LinkTrace(*link, one.seq + part.seq, one.t + part.t, one.outcome + part.outcome)
    return found
