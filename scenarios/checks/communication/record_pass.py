"""One pass over the file of a record: what was sent, heard and decided, in the order of the file.

`RunRecord` makes every message and decision again, to explain single ones. Checks look at all of them, and only at who
sent, heard and used which number. So this reads the entries of the journals as they stand, a chunk at a time.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import msgpack
import msgspec

from netem.ledger import LinkCounts, LinkTrace
from scenarios.checks.check_verdict import NotJudgedError
from scenarios.emulation.link_reports import data_of
from scenarios.record.decision_entries import is_periodic
from scenarios.record.journal_coverage import INSTANT, Hole, JournalCoverage
from scenarios.record.journal_reader import values_of
from scenarios.record.record_file import RecordFile
from wire.bounds import LIMIT
from wire.codec import sound
from wire.journal import Decision
from wire.journal_keys import kind_of, name_of
from wire.messages import PLANT, Journal, LinkReport, State
from wire.timing.clock import time_of

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


class RecordSink(Protocol):
    """Takes what a record has, in the order of its file: of each node as it was, of several within a second or so."""

    def state(self, agent: str, state: SentState) -> None:
        """Take a state that an agent sent; it may come twice."""
        ...

    def decision(self, agent: str, epoch: int, decision: Decision) -> None:
        """Take how an agent decided; in simulated time it holds until the next one."""
        ...

    def heard(self, link: Link, epoch: int, number: int, rejected: str) -> None:
        """Take a state that arrived in wall-clock time, and why it was rejected, if it was."""
        ...

    def counts(self, link: Link, counts: LinkCounts) -> None:
        """Take the account of an emulated link up to now."""
        ...

    def trace(self, trace: LinkTrace) -> None:
        """Take further verdicts of an emulated link."""
        ...

    def known_until(self, agent: str, t: float) -> None:
        """Take the run time (s) up to which it is known how an agent decided, where its journal comes all the time."""
        ...


@dataclass(frozen=True, kw_only=True)
class PassEnd:
    """What is known of a record once it was gone through."""

    unreadable: int
    """Number of messages, reports and parts of the file that could not be read."""
    lost: Mapping[str, Sequence[Hole]]
    """Simulated time: run times (s) between which parts of a node's journal are lost."""
    known_until: Mapping[str, float]
    """Simulated time: run time (s) behind which no part of a node's journal has come; infinite if none need come."""

    @property
    def holes(self) -> dict[str, Sequence[Hole]]:
        """Run times (s) between which it is not known how an agent decided, or what the plant heard."""
        return {name: [*self.lost[name], (t + INSTANT, inf)] for name, t in self.known_until.items()}


def opened(path: Path) -> RecordFile:
    """Open the file of a record.

    Raises
    ------
    NotJudgedError
        If it has no messages and decisions.
    RecordFileError
        If it is none.
    """
    file = RecordFile(path)
    if file.info.level == "physics":
        raise NotJudgedError('the run was recorded with record = "physics", without decisions')
    return file


def read_into(file: RecordFile, sink: RecordSink) -> PassEnd:
    """Give a sink all that a record has."""
    return _Pass(file, sink).read()


class _Pass:
    """One pass over the file of a record."""

    def __init__(self, file: RecordFile, sink: RecordSink) -> None:
        self._file, self._sink = file, sink
        self._unreadable = 0
        self._simulated = file.info.clock == "simulated"
        self._coverage: dict[str, JournalCoverage] = {}
        fields = file.info.fields.get(State.__name__, ())
        self._places = {name: fields.index(name) for name in _VALUES if name in fields}

    def read(self) -> PassEnd:
        for record in self._file.messages(("journal", "link_reports")):
            message = sound(record.data)
            if isinstance(message, Journal):
                ticks: list[int] = []
                for entry in _raw_entries(message.data):
                    self._take(message, entry)
                    if entry[0] in ("decision", "exchange"):
                        ticks.append(entry[1])
                if self._simulated:  # in wall-clock time each entry tells all by itself
                    self._cover(message, ticks)
            elif isinstance(message, LinkReport):
                self._report(message)
            else:
                self._unreadable += 1
        numbered, damaged = self._file.info.driver != "inprocess", self._file.holes
        return PassEnd(
            unreadable=self._unreadable + len(self._file.damage),
            lost={name: each.holes(damaged, numbered=numbered) for name, each in self._coverage.items()},
            known_until={name: each.known_until for name, each in self._coverage.items()},
        )

    def _cover(self, journal: Journal, ticks: list[int]) -> None:
        """Note which part of a journal is there, and the ticks of which it tells."""
        name, info = journal.sender, self._file.info
        if name not in self._coverage:
            self._coverage[name] = JournalCoverage(periodic=is_periodic(info, name))
        T_c = info.T_c
        times = (time_of(ticks[0], T_c), time_of(ticks[-1], T_c) if name == PLANT else journal.t) if ticks else None
        self._coverage[name].take(journal, lambda: times)
        if (t := self._coverage[name].known_until) < inf:
            self._sink.known_until(name, t)

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
            self._sink.heard((name_of(entry[2]), journal.sender), entry[3], entry[4], entry[5])
        elif kind == "decision" and journal.sender != PLANT:
            self._sink.decision(journal.sender, journal.epoch, msgspec.convert(entry, Decision))

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
            sender = str(values["sender"])
        except (KeyError, TypeError, ValueError):
            self._unreadable += 1
            return
        self._sink.state(sender, state)

    def _report(self, report: LinkReport) -> None:
        try:
            data = data_of(report)
        except msgspec.MsgspecError:
            self._unreadable += 1
            return
        for src, counts in data.counts.items():
            self._sink.counts((src, report.sender), counts)
        for trace in data.traces:
            self._sink.trace(trace)


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
