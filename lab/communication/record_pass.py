"""One pass over the file of a record: what was sent, heard and decided, in the order of the file.

`RunRecord` makes every message and decision again, to explain single ones. Checks look at all of them, and only at who
sent, heard and used which number. So this reads the entries of the journals as they stand, a chunk at a time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from gridpeers.lab.communication.sent_states import SentState
from gridpeers.netem.ledger import LinkCounts, LinkTrace
from gridpeers.scenarios.checks.check_verdict import NotJudgedError
from gridpeers.scenarios.emulation.link_data import data_of
from gridpeers.scenarios.record.decision_entries import INSTANT, Hole, JournalCoverage, is_periodic
from gridpeers.scenarios.record.journal_reader import entries_of, values_of
from gridpeers.scenarios.record.record_file import RecordFile
from gridpeers.wire.bounds import MOST_COUNT
from gridpeers.wire.codec import sound
from gridpeers.wire.journal import (
    Decision,
    Entry,
    Exchange,
    MessageReference,
    ProcessEvent,
    ReceivedMessage,
    RejectedCount,
    SentMessage,
    kind_of,
    name_of,
)
from gridpeers.wire.messages import PLANT, Journal, LinkReport, State
from gridpeers.wire.timing import time_of

Link = tuple[str, str]  # Sender and receiver

ON_WAY = 1.0
"""Longest time (s of wall time) that a state is on its way, as the check of the account has it by default."""

AHEAD = 5.0
"""How far (s of wall time) an entry may be ahead of its journal: far more than clocks of two processes differ by."""

_VALUES = ("sender", "seq", "t", "epoch", "idle", "quiet")  # Values of a state that checks need

_STATE_KEYS = ("state", "set_points")
"""First parts of the keys of states; one that is not for the neighbours has a key of its own."""

_NOT_SOUND = ("corrupt", "garbled")  # Kinds of rejected messages whose numbers are not those that were sent

_OF_SENDER = ("excess", "stale")
"""Kinds of rejection that a sender's own sound states may have, and of which a journal may have the number alone."""


class DroppedStates(NamedTuple):
    """States that a receiver dropped unread, sent between two run times (s); a stranger's may be among them."""

    number: int
    since: float
    until: float


class RecordSink:
    """Takes what a record has, in the order of its file: of each node as it was, of several within a second or so."""

    def state(self, agent: str, state: SentState) -> None:
        """Take a state that an agent sent; it may come twice."""

    def decision(self, agent: str, epoch: int, decision: Decision) -> None:
        """Take how an agent decided; in simulated time it holds until the next one."""

    def heard(self, link: Link, epoch: int, number: int, rejected: str) -> None:
        """Take a state that arrived in real time, and why it was rejected, if it was."""

    def dropped(self, link: Link, states: DroppedStates) -> None:
        """Take the number of states that a receiver dropped in real time, without more."""

    def renewed(self, agent: str, t: float) -> None:
        """Take that an agent opened a new session in real time, after its state of a run time (s)."""

    def counts(self, link: Link, counts: LinkCounts) -> None:
        """Take the account of an emulated link up to now."""

    def trace(self, trace: LinkTrace) -> None:
        """Take further verdicts of an emulated link."""

    def known_until(self, agent: str, t: float) -> None:
        """Take the run time (s) up to which it is known how an agent decided, where its journal comes all the time."""


@dataclass(frozen=True, kw_only=True)
class PassEnd:
    """Totals of a pass over a whole record."""

    unreadable: int
    """Messages, entries, reports and parts of the file that could not be read, or cannot be true."""
    lost: Mapping[str, Sequence[Hole]]
    """Simulated time: run times (s) between which parts of a node's journal are lost."""
    known_until: Mapping[str, float]
    """Simulated time: run time (s) behind which no part of a node's journal has come; infinite if none need come."""

    @property
    def holes(self) -> dict[str, Sequence[Hole]]:
        """Run times (s) between which it is not known how an agent decided, or what the plant heard."""
        return {name: [*self.lost[name], (t + INSTANT, inf)] for name, t in self.known_until.items()}


def opened(path: Path) -> RecordFile:
    """Open the file of a record; raise NotJudgedError if it has no messages and decisions."""
    file = RecordFile(path)
    if file.info.level == "physics":
        raise NotJudgedError('the run was recorded with record = "physics", without decisions')
    return file


def end_of(file: RecordFile) -> float:
    """Return the run time (s) at which a record ends: its latest one, unless the run was to end before.

    Nothing in the file is trusted, and one entry of a time that cannot be would put the end off.
    """
    end = file.info.plant.end
    return file.t_end if end is None else min(file.t_end, end)


def read_into(file: RecordFile, sink: RecordSink) -> PassEnd:
    """Give a sink all that a record has."""
    return _Pass(file, sink).read()


class _Pass:
    def __init__(self, file: RecordFile, sink: RecordSink) -> None:
        self._file, self._sink = file, sink
        info, self._unreadable = file.info, 0
        self._simulated, self._T_c = info.simulated, info.T_c
        self._t_end, self._speed = end_of(file), max(1.0, info.plant.speed)
        self._latest = self._t_end + AHEAD * self._speed
        self._most = int(self._latest / self._T_c) if self._simulated else MOST_COUNT
        """Largest number of a state: in simulated time that of its tick."""
        self._coverage: dict[str, JournalCoverage] = {}
        self._spoke: dict[str, float] = {}
        """Real time: run time (s) of the last own state in each agent's journal."""
        self._parts: dict[str, tuple[int, float, float]] = {}
        """Epoch of each sender's last part, its run time (s), and that of the last one before that time."""
        fields = info.fields.get(State.__name__, ())
        self._length = len(fields)
        self._places = {name: fields.index(name) for name in _VALUES if name in fields}

    def read(self) -> PassEnd:
        for record in self._file.messages(("journal", "link_reports")):
            message = sound(record.data)
            if isinstance(message, Journal):
                self._journal(message)
            elif isinstance(message, LinkReport):
                self._report(message)
            else:
                self._unreadable += 1
        return PassEnd(
            unreadable=self._unreadable + len(self._file.damage),
            lost={name: each.holes(self._file.holes) for name, each in self._coverage.items()},
            known_until={name: each.known_until for name, each in self._coverage.items()},
        )

    def _journal(self, journal: Journal) -> None:
        """Take a part of a journal, as far as it can be read; in simulated time what is not whole is lost."""
        before, ticks = self._unreadable, list[int]()
        self._note_part(journal)
        for entry in entries_of(journal.data, self._count_damage):
            if isinstance(entry, Decision | Exchange):
                if not self._is_timely(journal, time_of(entry.tick, self._T_c) if self._simulated else journal.t):
                    self._unreadable += 1
                    continue
                ticks.append(entry.tick)
            self._take(journal, entry)
        if self._simulated and self._unreadable == before:  # in real time each entry tells all by itself
            self._cover(journal, ticks)

    def _count_damage(self, error: ValueError) -> None:
        self._unreadable += 1

    def _is_timely(self, journal: Journal, t: float) -> bool:
        """Return whether an entry of a journal may be about a run time (s): nobody tells of what is yet to come.

        The plant's run time may stand still for a while, as it is frozen, so its journal counts as of the run's end.
        """
        at = inf if journal.sender == PLANT else journal.t + AHEAD * self._speed
        return 0.0 <= t <= min(self._latest, at)

    def _cover(self, journal: Journal, ticks: list[int]) -> None:
        """Note which part of a journal is there, and the ticks of which it tells."""
        name, T_c = journal.sender, self._T_c
        if name not in self._coverage:
            self._coverage[name] = JournalCoverage(periodic=is_periodic(self._file.info, name))
        times = (time_of(ticks[0], T_c), time_of(ticks[-1], T_c) if name == PLANT else journal.t) if ticks else None
        self._coverage[name].take(journal, lambda: times)
        if (t := self._coverage[name].known_until) < inf:
            self._sink.known_until(name, t)

    def _take(self, journal: Journal, entry: Entry) -> None:
        match entry:
            case Exchange(states=states):
                for raw in states:
                    self._state(journal, raw)
            case SentMessage(key=key, payload=payload) | ReceivedMessage(key=key, payload=payload, rejected=""):
                if kind_of(key) in _STATE_KEYS:
                    self._state(journal, payload)
            case MessageReference(key=key, epoch=epoch, seq=number, rejected=rejected):
                if kind_of(key) == "state":
                    self._sink.heard((name_of(key), journal.sender), epoch, number, rejected)
            case ReceivedMessage(key=key):
                if kind_of(key) == "state":
                    self._rejected(journal, name_of(key), entry)
            case RejectedCount(key=key, kind=kind, count=count):
                if kind_of(key) == "state" and kind in _OF_SENDER:
                    self._dropped(journal, name_of(key), count)
            case ProcessEvent(kind="session") if not self._simulated and journal.sender in self._spoke:
                self._sink.renewed(journal.sender, self._spoke[journal.sender])
            case Decision() if journal.sender != PLANT:
                self._sink.decision(journal.sender, journal.epoch, entry)

    def _state(self, journal: Journal, raw: Any) -> None:
        values: Mapping[str, Any] = {}
        if isinstance(raw, bytes):
            values = values_of(raw)
        elif isinstance(raw, list) and len(raw) == self._length:
            values = {name: raw[place] for name, place in self._places.items()}
        try:
            state = SentState(
                int(values["seq"]), float(values["t"]), int(values["epoch"]),
                bool(values.get("idle")), bool(values.get("quiet")),
            )  # fmt: skip
            sender = str(values["sender"])
        except (KeyError, TypeError, ValueError, OverflowError):
            self._unreadable += 1
            return
        numbers = 0 <= state.number <= self._most and 0 <= state.epoch <= MOST_COUNT
        if numbers and self._is_timely(journal, state.t):
            self._sink.state(sender, state)
            if sender == journal.sender:
                self._spoke[sender] = state.t
        else:
            self._unreadable += 1

    def _rejected(self, journal: Journal, src: str, message: ReceivedMessage) -> None:
        """Take a message that was rejected: it arrived, if it is a state of the sender that its key names."""
        if message.rejected not in _NOT_SOUND:
            match values_of(message.payload):
                case {"sender": str(sender), "epoch": int(epoch), "seq": int(number)} if sender == src:
                    self._sink.heard((src, journal.sender), epoch, number, message.rejected)

    def _note_part(self, journal: Journal) -> None:
        """Note when a part of a journal was sent: no part is believed to be later than the record's end."""
        t = min(journal.t, self._t_end)
        epoch, last, earlier = self._parts.get(journal.sender, (journal.epoch, t, t))
        if epoch != journal.epoch:
            last = earlier = t
        if t > last:
            last, earlier = t, last
        self._parts[journal.sender] = journal.epoch, last, earlier

    def _dropped(self, journal: Journal, src: str, count: int) -> None:
        """Take that a receiver dropped states after it sent the part of its journal before this one."""
        _, last, earlier = self._parts[journal.sender]
        way = ON_WAY * self._speed
        self._sink.dropped((src, journal.sender), DroppedStates(count, earlier - way, last + way))

    def _report(self, report: LinkReport) -> None:
        try:
            data = data_of(report)
        except msgspec.MsgspecError:
            self._unreadable += 1
            return
        for src, counts in data.counts.items():
            self._sink.counts((src, report.sender), counts)
        for trace in data.traces:
            self._sink.trace(self._credible(trace))

    def _credible(self, trace: LinkTrace) -> LinkTrace:
        """Return the verdicts on messages that may have been sent, and count the others."""
        if max(trace.seq, default=0) <= self._most and max(trace.t, default=0.0) <= self._latest:
            return trace
        every = zip(trace.seq, trace.t, trace.outcome, strict=True)
        rows = [row for row in every if row[0] <= self._most and row[1] <= self._latest]
        self._unreadable += len(trace.seq) - len(rows)
        seq, t, outcome = zip(*rows, strict=True) if rows else ((), (), ())
        return LinkTrace(trace.src, trace.dst, seq, t, outcome)
