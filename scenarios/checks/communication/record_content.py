"""What the checks of communication need of a record, taken in one pass over its file.

`RunRecord` makes every message and decision again, to explain single ones. Checks look at all of them, and only at who
sent, heard and used which number. So this reads the entries of the journals as they stand.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import msgpack
import msgspec

from netem.ledger import LinkCounts, LinkTrace
from scenarios.checks.check_verdict import NotJudgedError
from scenarios.emulation.link_reports import data_of
from scenarios.record.decision_entries import is_periodic
from scenarios.record.journal_coverage import INSTANT, Hole, JournalCoverage, inside
from scenarios.record.journal_reader import values_of
from scenarios.record.record_file import RecordFile
from scenarios.record.record_info import RecordInfo
from wire.bounds import LIMIT
from wire.codec import sound
from wire.journal import Decision
from wire.journal_keys import kind_of, name_of
from wire.messages import PLANT, Journal, LinkReport, State
from wire.timing.clock import time_of

MOST_BYTES = 64_000_000
"""Largest record that is read for a verdict: some ten minutes of nine agents, which take ten seconds."""

Link = tuple[str, str]
"""Sender and receiver."""


class SentState(NamedTuple):
    """A state that an agent sent."""

    number: int
    """Its number."""
    t: float
    """Run time (s)."""
    epoch: int
    """Epoch of its process."""
    idle: bool
    """Whether the agent decided nothing: it was paused, or had no measurement."""
    quiet: bool
    """Whether it was not for the neighbours: its law kept its last state in force."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordContent:
    """States sent and heard, decisions, and accounts of emulated links."""

    info: RecordInfo
    """The run."""
    t_end: float = 0.0
    """Latest run time in the record (s)."""
    states: Mapping[str, dict[tuple[int, int], SentState]] = field(default_factory=dict)
    """States of each agent by epoch and number, in the order of time."""
    decisions: Mapping[str, list[tuple[int, Decision]]] = field(default_factory=dict)
    """How each agent decided, with its epoch, in the order of time; in simulated time each holds until the next one."""
    holes: Mapping[str, Sequence[Hole]] = field(default_factory=dict)
    """Simulated time: run times (s) between which it is not known how an agent decided, or what the plant heard: the
    file is damaged there, or the rest of a journal is missing."""
    heard: Mapping[Link, dict[tuple[int, int], str]] = field(default_factory=dict)
    """Wall-clock time: epoch and number of each state that arrived, and why it was rejected, if it was."""
    counts: Mapping[Link, LinkCounts] = field(default_factory=dict)
    """Last account of each emulated link."""
    traces: Mapping[Link, list[LinkTrace]] = field(default_factory=dict)
    """Verdicts of each emulated link."""
    unreadable: int = 0
    """Messages and reports that could not be read."""
    complete: bool = True
    """Whether the record was closed properly."""

    @property
    def simulated(self) -> bool:
        """Whether the run kept simulated time."""
        return self.info.clock == "simulated"

    @property
    def agents(self) -> tuple[str, ...]:
        """All configured agents."""
        return tuple(config.name for config in self.info.agents)

    def of_agent(self, agent: str) -> list[SentState]:
        """Return the states of an agent in the order of time."""
        return self._in_order.get(agent, [])

    @cached_property
    def _in_order(self) -> dict[str, list[SentState]]:
        return {agent: sorted(of.values(), key=lambda state: state.t) for agent, of in self.states.items()}

    def segments(self, agent: str) -> Iterator[tuple[Decision, list[SentState]]]:
        """Yield how an agent decided, each with the states that came out: not those in which it was idle."""
        holes = self.holes.get(agent, ())
        own = [state for state in self.of_agent(agent) if not (state.idle or inside(holes, state.t))]
        entries = self.decisions.get(agent, [])
        if self.simulated:
            ticks = [entry.tick for _, entry in entries]
            parts: list[list[SentState]] = [[] for _ in entries]
            for state in own:
                at = bisect_right(ticks, state.number) - 1
                if at >= 0:
                    parts[at].append(state)
            yield from ((entry, part) for (_, entry), part in zip(entries, parts, strict=True) if part)
            return
        known = self.states.get(agent, {})
        for epoch, entry in entries:
            sent = known.get((epoch, entry.tick))
            if sent is not None and not sent.idle:
                yield entry, [sent]


def read_content(path: Path) -> RecordContent:
    """Read the file of a record.

    Raises
    ------
    NotJudgedError
        If it has no messages and decisions, or is too large for a verdict.
    RecordFileError
        If it is none.
    """
    file = RecordFile(path)
    if file.info.level == "physics":
        raise NotJudgedError('the run was recorded with record = "physics", without decisions')
    if (size := path.stat().st_size) > MOST_BYTES:
        raise NotJudgedError(
            f"its record has {size / 1e6:.0f} MB, more than the {MOST_BYTES / 1e6:.0f} MB that are read"
        )
    return _Pass(file).content()


class _Pass:
    """One pass over the file of a record."""

    def __init__(self, file: RecordFile) -> None:
        self._file, self._info = file, file.info
        self._states: dict[str, dict[tuple[int, int], SentState]] = defaultdict(dict)
        self._decisions: dict[str, dict[tuple[int, int], Decision]] = defaultdict(dict)
        self._coverage: dict[str, JournalCoverage] = {}
        self._heard: dict[Link, dict[tuple[int, int], str]] = defaultdict(dict)
        self._counts: dict[Link, LinkCounts] = {}
        self._traces: dict[Link, list[LinkTrace]] = defaultdict(list)
        self._unreadable = 0
        fields = self._info.fields.get(State.__name__, ())
        self._places = {name: fields.index(name) for name in _VALUES if name in fields}

    def content(self) -> RecordContent:
        for record in self._file.messages(("journal", "link_reports")):
            message = sound(record.data)
            if isinstance(message, Journal):
                ticks: list[int] = []
                for entry in _raw_entries(message.data):
                    self._take(message, entry)
                    if entry[0] in ("decision", "exchange"):
                        ticks.append(entry[1])
                self._cover(message, ticks)
            elif isinstance(message, LinkReport):
                self._report(message)
            else:
                self._unreadable += 1
        return RecordContent(
            info=self._info,
            t_end=self._file.t_end,
            states=self._states,
            decisions={agent: self._in_order(of) for agent, of in self._decisions.items()},
            holes=self._holes(),
            heard=self._heard,
            counts=self._counts,
            traces=self._traces,
            unreadable=self._unreadable + len(self._file.damage),
            complete=self._file.complete,
        )

    def _in_order(self, of: dict[tuple[int, int], Decision]) -> list[tuple[int, Decision]]:
        entries = [(epoch, decision) for (epoch, _), decision in of.items()]
        return sorted(entries, key=lambda each: each[1].tick) if self._info.clock == "simulated" else entries

    def _cover(self, journal: Journal, ticks: list[int]) -> None:
        """Note which part of a journal is there, and the ticks of which it tells."""
        name = journal.sender
        if name not in self._coverage:
            self._coverage[name] = JournalCoverage(periodic=is_periodic(self._info, name))
        T_c = self._info.T_c
        times = (time_of(ticks[0], T_c), time_of(ticks[-1], T_c) if name == PLANT else journal.t) if ticks else None
        self._coverage[name].take(journal, lambda: times)

    def _holes(self) -> dict[str, Sequence[Hole]]:
        """Return the run times (s) between which it is not known how each node decided."""
        if self._info.clock != "simulated":  # each entry tells all by itself
            return {}
        numbered, damaged = self._info.driver != "inprocess", self._file.holes
        return {
            name: [*each.holes(damaged, numbered=numbered), (each.known_until + INSTANT, inf)]
            for name, each in self._coverage.items()
        }

    def _take(self, journal: Journal, entry: Any) -> None:
        kind = entry[0]
        if kind == "exchange":
            for raw in entry[3]:
                self._state(raw)
        elif (
            kind in ("sent", "received") and kind_of(entry[2]) in _STATE_KEYS and not (kind == "received" and entry[4])
        ):
            self._state(entry[3])
        elif kind == "heard" and kind_of(entry[2]) == "state":
            self._heard[name_of(entry[2]), journal.sender][entry[3], entry[4]] = entry[5]
        elif kind == "decision" and journal.sender != PLANT:
            decision = msgspec.convert(entry, Decision)
            self._decisions[journal.sender][journal.epoch, decision.tick] = decision

    def _state(self, raw: Any) -> None:
        if isinstance(raw, bytes):
            values = values_of(raw)
        else:
            values = {name: raw[place] for name, place in self._places.items()}
        try:
            state = SentState(
                int(values["seq"]), float(values["t"]), int(values["epoch"]),
                bool(values.get("idle")), bool(values.get("quiet")),
            )  # fmt: skip
            self._states[str(values["sender"])].setdefault((state.epoch, state.number), state)
        except (KeyError, TypeError, ValueError):
            self._unreadable += 1

    def _report(self, report: LinkReport) -> None:
        try:
            data = data_of(report)
        except msgspec.MsgspecError:
            self._unreadable += 1
            return
        self._counts |= {(src, report.sender): counts for src, counts in data.counts.items()}
        for trace in data.traces:
            self._traces[trace.src, trace.dst].append(trace)


_VALUES = ("sender", "seq", "t", "epoch", "idle", "quiet")
"""Values of a state that checks need."""

_STATE_KEYS = ("state", "set_points")
"""First parts of the keys of states; one that is not for the neighbours has a key of its own."""


def _raw_entries(data: bytes) -> Iterator[list[Any]]:
    """Yield the entries of a part of a journal as lists, up to where they cannot be read."""
    unpacker = msgpack.Unpacker(max_buffer_size=LIMIT, max_array_len=LIMIT, max_map_len=LIMIT, strict_map_key=False)
    unpacker.feed(data)
    try:
        yield from unpacker
    except (msgpack.UnpackException, ValueError, RecursionError):
        return
