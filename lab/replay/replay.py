"""Replay of a record: every core gets its inputs again, and decides the same, or the first difference is named.

In real time each process is made again and called as its journal says: start, tokens, messages at the times of
their arrival, and its clock. Nothing of the replay goes to another process, so a difference stays where it arises.

In simulated time the scenario alone decides what arrives. So the run is made again in one process, and the decisions
of each agent from the states that it had heard by its record.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from heapq import merge
from itertools import zip_longest
from math import inf, isnan
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from msgspec.structs import replace

from gridpeers.agents.carriers.law_registry import close_laws
from gridpeers.agents.laws.law import Law
from gridpeers.lab.replay.recomputation import recomputed
from gridpeers.lab.replay.recorded_process import (
    KeyedMessage,
    MakePlant,
    RecordedProcess,
    RecordedStep,
    ReplayedProcess,
    agent_again,
    made_here,
    plant_again,
    processes_of,
    recorded_links,
    require_arrivals,
    start_plant_of,
    tick_message,
)
from gridpeers.plant.build import start_plant
from gridpeers.scenarios.console import in_order
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.scenarios.results.case_tables import QUANTITIES
from gridpeers.wire.codec import decode
from gridpeers.wire.messages import PLANT, AnyMessage, Measurement, Telemetry

if TYPE_CHECKING:
    from gridpeers.runs.result import Result

TOLERANCE = 1e-9  # Largest difference of two numbers that count as the same, in their units: set-points in W and V

UNITS = {"P": "W", "Q": "var", "V": "V", "f": "Hz", "P_set": "W", "V_set": "V", "t": "s"}


@dataclass
class ReplayedPart:
    name: str
    note: str = ""
    count: int = 0
    """Number of states of an agent, or of rows of the plant, that were compared."""
    t_end: float = 0.0
    difference: ReplayDifference | None = None

    @property
    def is_over(self) -> bool:
        return bool(self.note) or self.difference is not None

    def compare(self, t: float, difference: ReplayDifference | None) -> None:
        self.difference = difference
        if difference is None:
            self.count, self.t_end = self.count + 1, t


@dataclass(frozen=True, kw_only=True)
class ReplayedRun:
    parts: tuple[ReplayedPart, ...]

    @property
    def difference(self) -> ReplayDifference | None:
        """First difference in run time; None if the replay equals the record, as far as it goes."""
        found = [part.difference for part in self.parts if part.difference is not None]
        return min(found, key=lambda difference: difference.t, default=None)

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on parts that were not compared; those on damage of the record itself are `RunRecord.damage`."""
        return tuple(dict.fromkeys(part.note for part in self.parts if part.note))


def replay(run: Result | RunRecord | str | Path, make_plant: MakePlant | None = start_plant) -> ReplayedRun:
    """Give plant and agents of a recorded run their inputs again, and compare their decisions with the record.

    `make_plant` starts the plant; None leaves the physics out. Raise RecordFileError if the record cannot be read, and
    ReplayError if it lacks the inputs, or if its law, graph or feeder is missing.
    """
    record = record_of(run)
    require_arrivals(record)
    own = record.info.plant.settings.simulator == "gridpeers" and not record.info.plant.bridged
    found = list((_in_simulated_time if record.info.simulated else _in_real_time)(record, make_plant if own else None))
    if not own:
        note = "the physics was not replayed: another simulator was part of the plant"
        found.append(ReplayedPart(PLANT, note))
    names = [PLANT, *in_order({part.name for part in found} - {PLANT})]
    return ReplayedRun(parts=tuple(sorted(found, key=lambda part: names.index(part.name))))


def record_of(run: Result | RunRecord | str | Path) -> RunRecord:
    """Return the record of a result, or that in the folder of a case."""
    if isinstance(run, RunRecord):
        return run
    return RunRecord.open(run) if isinstance(run, str | Path) else run.run_record


# -------------------------------------------------------------------- differences


class ReplayDifference(NamedTuple):
    name: str
    t: float
    quantity: str
    recorded: Any
    replayed: Any
    unit: str = ""

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        recorded, replayed = (repr(it) if isinstance(it, float | str) else str(it) for it in self[3:5])
        return (
            f"{self.name} at t = {self.t:.2f} s: {self.quantity} is {recorded}{unit} in the record "
            f"and {replayed}{unit} in the replay"
        )


def same(a: Any, b: Any) -> bool:
    if isinstance(a, float) and isinstance(b, float):
        return a == b or abs(a - b) <= TOLERANCE or (isnan(a) and isnan(b))
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(same(a[name], b[name]) for name in a)
    return bool(a == b)


def message_difference(recorded: AnyMessage | None, replayed: AnyMessage | None) -> ReplayDifference | None:
    """Return the first field in which two states, or two measurements, differ; None if there is none."""
    known = recorded or replayed
    if known is None:
        return None
    name = known.to if isinstance(known, Measurement) else known.sender
    if recorded is None or replayed is None or type(recorded) is not type(replayed):
        there = ("missing" if message is None else "there" for message in (recorded, replayed))
        return ReplayDifference(name, known.t, f"the {type(known).__name__} {known.seq}", *there)
    for field in recorded.__struct_fields__:
        a, b = getattr(recorded, field), getattr(replayed, field)
        if not same(a, b):
            return ReplayDifference(name, recorded.t, field, a, b, UNITS.get(field, ""))
    return None


def row_difference(
    inverters: tuple[str, ...], recorded: tuple[float, ...], replayed: tuple[float, ...]
) -> ReplayDifference | None:
    """Return the first quantity in which two rows of the plant differ; None if there is none."""
    if len(recorded) != len(replayed):
        return ReplayDifference("plant", recorded[0], "the number of columns", len(recorded), len(replayed))
    columns = ((name, quantity) for name in inverters for quantity in QUANTITIES)
    for (name, quantity), a, b in zip(columns, recorded[1:], replayed[1:], strict=True):
        if not same(a, b):
            symbol, _, unit = quantity.rpartition("_")
            return ReplayDifference(name, recorded[0], symbol, a, b, unit)
    return None


# -------------------------------------------------------------------- real time


def _in_real_time(record: RunRecord, make_plant: MakePlant | None) -> Iterator[ReplayedPart]:
    plant = None if make_plant is None else start_plant_of(record.info, make_plant)
    laws: list[Law] = []
    try:
        replays: list[_AgentReplay | _PlantReplay] = []
        for process in processes_of(record):
            if process.name != PLANT:
                replays.append(_AgentReplay(record, process, laws))
            elif plant is not None:
                again = plant_again(process, record.info, plant, recorded_links(record.info, PLANT))
                replays.append(_PlantReplay(record, process, again))
        for _, number, step in merge(*(_by_time(number, each) for number, each in enumerate(replays))):
            if not replays[number].part.is_over:
                replays[number].take(step)
        for each in replays:
            each.end()
            each.part.note = each.part.note or each.process.ends
            yield each.part
    finally:
        close_laws(laws)
        if plant is not None:
            plant.close()


def _by_time(number: int, replay: _PlantReplay | _AgentReplay) -> Iterator[tuple[float, int, RecordedStep]]:
    for step in replay.process.steps():
        if replay.part.is_over:
            return
        yield step.due, number, step


class _AgentReplay:
    def __init__(self, record: RunRecord, process: RecordedProcess, laws: list[Law]) -> None:
        self.process, self.part, self._info, self._laws = process, ReplayedPart(process.name), record.info, laws
        self._again: ReplayedProcess | None = None

    def take(self, step: RecordedStep) -> None:
        name, part = self.process.name, self.part
        if self._again is None:
            config = self._info.agent(name)
            if config is None or not step.instance:
                part.note = f"the record lacks the start of {name}, or its configuration: it was not replayed"
                return
            links = recorded_links(self._info, name)
            self._again = agent_again(self.process, config, step.instance, self._laws, links)
        message = self.process.message(step)
        if message is None and step.is_arrival:
            part.note = f"the record lacks a message that {name} heard at t = {step.t:.2f} s; its replay ends there"
            return
        ours = [decoded for sent in self._again.take(step, message) if (decoded := tick_message(sent)) is not None]
        theirs = [decoded for sent in step.sent if (decoded := tick_message(sent)) is not None]
        for a, b in zip_longest(theirs, ours[: len(theirs)] if step.last else ours):
            part.compare((a or b).t, message_difference(a, b))
            if part.difference is not None:
                return

    def end(self) -> None:
        pass


class _PlantReplay:
    def __init__(self, record: RunRecord, process: RecordedProcess, again: ReplayedProcess) -> None:
        self.process, self._again, self._rows = process, again, ComparedRows(record)
        self.part = self._rows.part

    def take(self, step: RecordedStep) -> None:
        self._compare(self._again.take(step, self.process.message(step)))

    def end(self) -> None:
        self._compare(self._again.end())

    def _compare(self, sent: list[KeyedMessage]) -> None:
        for message in sent:
            if message.key == "telemetry":
                self._rows.take(decode(message.payload))


# -------------------------------------------------------------------- both


class ComparedRows:
    """The rows of the plant beside those of the record, as they come, up to a run time (s)."""

    def __init__(self, record: RunRecord, until: float = inf) -> None:
        self._until = until
        self._rows = ((message.inverters, row) for message in record.telemetry() for row in message.rows)
        self._next: tuple[tuple[str, ...], tuple[float, ...]] | None = next(self._rows, None)
        self._numbers = -1
        self.part = ReplayedPart(PLANT)

    def take(self, message: AnyMessage) -> None:
        """Compare the rows of telemetry that come again; some may be missing in the record."""
        if not isinstance(message, Telemetry) or message.seq <= self._numbers:
            return
        self._numbers = message.seq
        for row in message.rows:
            while self._next is not None and self._next[1][0] < row[0] - 1e-9:
                self._next = next(self._rows, None)
            if self._next is None or self.part.difference is not None or row[0] > self._until + 1e-9:
                return
            inverters, recorded = self._next
            if recorded[0] <= row[0] + 1e-9:
                self.part.compare(row[0], row_difference(inverters, recorded, row))


# -------------------------------------------------------------------- simulated time


def _in_simulated_time(record: RunRecord, make_plant: MakePlant | None) -> Iterator[ReplayedPart]:
    if make_plant is not None:
        rows = ComparedRows(record)
        T_c, end = record.info.plant.T_c, record.info.plant.end or inf
        recorded = (int(record.t_end / T_c) + 1) * T_c  # a killed run may have been meant to go on
        broke = run_again(record, rows.take, make_plant, end=min(end, recorded))
        if not all(message.reproducible for message in record.telemetry()):
            rows.part.note = "this run had an event that its scenario does not have, so it cannot be repeated"
        elif broke and record.outcome == "":
            rows.part.note = f"the repeated run breaks: {broke}"
        yield rows.part
    for agent in record.agents:
        yield _decisions(record, agent)


def run_again(
    record: RunRecord,
    take: Callable[[Any], None],
    make_plant: MakePlant,
    *,
    of_agents: Mapping[str, Any] = MappingProxyType({}),
    **of_plant: Any,
) -> str:
    """Run a scenario in simulated time again, with other values of configurations; return why it broke, if it did."""
    info = record.info
    with closing(start_plant_of(info, make_plant)) as plant, made_here("the run cannot be repeated here"):
        return run_inprocess(
            replace(info.plant, record="physics", **of_plant),
            [replace(agent, record="physics", **of_agents) for agent in info.agents],
            take,
            on_other=take,
            plant=plant,
        ).broke


def _decisions(record: RunRecord, agent: str) -> ReplayedPart:
    part = ReplayedPart(agent)
    with made_here(f"{agent}: its law cannot be loaded here"):
        for each in recomputed(record, agent):
            part.compare(each.decision.t, message_difference(each.decision.state, each.state))
            if part.difference is not None:
                return part
    if record.damage and part.t_end < record.t_end - 1.5 * record.info.T_c:
        part.note = "the record lacks the last decisions of some agents; they were not compared"
    return part
