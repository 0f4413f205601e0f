"""One pass over the file of a record: what was sent, heard and decided, in the order of the file.

`RunRecord` makes every message and decision again, to explain single ones. Checks look at all of them, and only at who
sent, heard and used which number. So this reads the entries of the journals as they stand, a chunk at a time.
"""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any, Self

import msgspec

from gridpeers.lab.communication.sent_states import Link, SentState
from gridpeers.netem.ledger import LinkCounts, LinkTrace
from gridpeers.scenarios.checks.check_verdict import NotJudgedError
from gridpeers.scenarios.emulation.link_data import data_of
from gridpeers.scenarios.record.decision_reader import JournalEnds
from gridpeers.scenarios.record.journal_reader import entries_of, values_of
from gridpeers.scenarios.record.record_file import RecordFile
from gridpeers.scenarios.record.record_info import RecordInfo
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
from gridpeers.wire.messages import MOST_COUNT, PLANT, Journal, LinkReport, State
from gridpeers.wire.timing import time_of

AHEAD = 5.0
"""How far (s of real time) an entry may be behind the record's end: far more than clocks of two processes differ by."""

_STATE_KEYS = ("state", "set_points")
"""First parts of the keys of states; one that is not for the neighbours has a key of its own."""

_VALUES = ("seq", "t", "epoch", "sender", "idle", "quiet")  # Fields of a state that a pass looks at

_NOT_SOUND = ("corrupt", "garbled")  # Kinds of rejected messages whose numbers are not those that were sent

_OF_SENDER = ("excess", "stale")
"""Kinds of rejection that may meet sound states of a sender. A journal may have only the number of such states."""


class RecordPass:
    """One pass over the file of a record. What it takes comes by time for one node, within a second for several."""

    def __init__(self, info: RecordInfo, t_end: float) -> None:
        self.info, self.t_end = info, t_end
        self.counts: dict[Link, LinkCounts] = {}
        """Accounts of emulated links."""
        self.dropped: dict[Link, int] = defaultdict(int)
        """Real time: how many states a receiver dropped unread."""
        self.unreadable = 0
        """Messages, entries, reports and parts of the file that could not be read, or cannot be true."""
        self.journal_ends = JournalEnds(info)
        self._latest = t_end + AHEAD * max(1.0, info.plant.speed)
        self._most = int(self._latest / info.T_c) if info.simulated else MOST_COUNT
        """Largest number of a state: in simulated time that of its tick."""
        self._spoke: dict[str, float] = {}
        """Real time: run time (s) of the last own state in each agent's journal."""
        fields = info.fields.get(State.__name__, ())
        self._length = len(fields)
        self._places = {name: fields.index(name) for name in _VALUES if name in fields}

    def take_state(self, agent: str, state: SentState) -> None:
        """Take a state that an agent sent; it may come twice."""

    def take_decision(self, agent: str, epoch: int, decision: Decision) -> None:
        """Take how an agent decided; in simulated time it holds until the next one."""

    def take_heard(self, link: Link, epoch: int, number: int, rejected: str) -> None:
        """Take a state that arrived in real time, and why it was rejected, if it was."""

    def take_renewed(self, agent: str, t: float) -> None:
        """Take that an agent opened a new session in real time, after its state of a run time (s)."""

    def take_trace(self, trace: LinkTrace) -> None:
        """Take further verdicts of an emulated link."""

    def read(self, file: RecordFile) -> Self:
        for record in file.messages(("journal", "link_reports")):
            message = sound(record.data)
            if isinstance(message, Journal):
                self._journal(message)
            elif isinstance(message, LinkReport):
                self._report(message)
            else:
                self.unreadable += 1
        self.unreadable += len(file.damage)
        self.t_end = min(self.t_end, file.t_end)
        return self

    def _journal(self, journal: Journal) -> None:
        """Take a part of a journal, as far as it can be read."""
        simulated, T_c = self.info.simulated, self.info.T_c
        self.journal_ends.take(journal)
        for entry in entries_of(journal.data, self._count_damage):
            if isinstance(entry, Decision | Exchange) and not (
                0 <= (time_of(entry.tick, T_c) if simulated else journal.t) <= self._latest
            ):
                self.unreadable += 1
            else:
                self._take(journal, entry)

    def _count_damage(self, error: ValueError) -> None:
        self.unreadable += 1

    def _take(self, journal: Journal, entry: Entry) -> None:
        receiver = journal.sender
        match entry:
            case Exchange(states=states):
                for raw in states:
                    self._state(journal, raw)
            case SentMessage(key=key, payload=payload) | ReceivedMessage(key=key, payload=payload, rejected=""):
                if kind_of(key) in _STATE_KEYS:
                    self._state(journal, payload)
            case MessageReference(key=key, epoch=epoch, seq=number, rejected=rejected):
                if kind_of(key) == "state":
                    self.take_heard((name_of(key), receiver), epoch, number, rejected)
            case ReceivedMessage(key=key, payload=payload, rejected=rejected):
                if kind_of(key) == "state" and rejected not in _NOT_SOUND:  # it arrived, if its key names its sender
                    match values_of(payload):
                        case {"sender": str(src), "epoch": int(epoch), "seq": int(number)} if src == name_of(key):
                            self.take_heard((src, receiver), epoch, number, rejected)
            case RejectedCount(key=key, kind=kind, count=count):
                if kind_of(key) == "state" and kind in _OF_SENDER:
                    self.dropped[name_of(key), receiver] += count
            case ProcessEvent(kind="session") if not self.info.simulated and receiver in self._spoke:
                self.take_renewed(receiver, self._spoke[receiver])
            case Decision() if receiver != PLANT:
                self.take_decision(receiver, journal.epoch, entry)

    def _state(self, journal: Journal, raw: Any) -> None:
        values: dict[str, Any] = {}
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
            self.unreadable += 1
            return
        credible = 0 <= state.number <= self._most and 0 <= state.epoch <= MOST_COUNT
        if not (credible and 0.0 <= state.t <= self._latest):
            self.unreadable += 1
            return
        self.take_state(sender, state)
        if sender == journal.sender:
            self._spoke[sender] = state.t

    def _report(self, report: LinkReport) -> None:
        try:
            data = data_of(report)
        except msgspec.MsgspecError:
            self.unreadable += 1
            return
        for src, counts in data.counts.items():
            self.counts[src, report.sender] = counts
        for trace in data.traces:
            rows = list(zip(trace.seq, trace.t, trace.outcome, strict=True))
            credible = [row for row in rows if row[0] <= self._most and row[1] <= self._latest]
            self.unreadable += len(rows) - len(credible)
            if credible:
                self.take_trace(LinkTrace(trace.src, trace.dst, *zip(*credible, strict=True)))


def opened(path: Path) -> tuple[RecordFile, float]:
    """Open the file of a record, and return it with its end (s of run time): no entry is later than the planned end.

    Raise NotJudgedError if it has no messages and decisions.
    """
    file = RecordFile(path)
    if file.info.level == "physics":
        raise NotJudgedError('the run was recorded with record = "physics", without decisions')
    end = file.info.plant.end
    return file, file.t_end if end is None else min(file.t_end, end)


# -------------------------------------------------------------------- all of it in memory


MOST_BYTES = 64_000_000  # Largest record that is taken into memory: some ten minutes of nine agents


class RecordContent(RecordPass):
    """All messages and decisions of a record, up to `MOST_BYTES`, for checks of a user's own."""

    def __init__(self, info: RecordInfo, t_end: float) -> None:
        super().__init__(info, t_end)
        self.states: dict[str, dict[tuple[int, int], SentState]] = defaultdict(dict)
        """States of each agent by epoch and number, in the order of the file."""
        self.decisions: dict[str, list[tuple[int, Decision]]] = defaultdict(list)
        """How each agent decided, with its epoch, in the order of time; in simulated time each holds until the next."""
        self.heard: dict[Link, dict[tuple[int, int], str]] = defaultdict(dict)
        """Real time: epoch and number of each state that arrived, and why it was rejected, if it was."""
        self.traces: dict[Link, list[LinkTrace]] = defaultdict(list)
        """Verdicts of each emulated link."""
        self.complete = True
        """The record was closed properly."""

    def take_state(self, agent: str, state: SentState) -> None:
        self.states[agent].setdefault((state.epoch, state.number), state)

    def take_decision(self, agent: str, epoch: int, decision: Decision) -> None:
        self.decisions[agent].append((epoch, decision))

    def take_heard(self, link: Link, epoch: int, number: int, rejected: str) -> None:
        self.heard[link][epoch, number] = rejected

    def take_trace(self, trace: LinkTrace) -> None:
        self.traces[trace.src, trace.dst].append(trace)


def read_content(path: Path) -> RecordContent:
    """Read the file of a record; raise NotJudgedError if it has no decisions, or is too large for the memory."""
    file, t_end = opened(path)
    if (size := path.stat().st_size) > MOST_BYTES:
        raise NotJudgedError(
            f"its record has {size / 1e6:.0f} MB, more than the {MOST_BYTES / 1e6:.0f} MB that are taken into memory"
        )
    found = RecordContent(file.info, t_end).read(file)
    found.complete = file.complete
    for agent, decisions in found.decisions.items():  # a part of a journal may come twice, or late
        known = {(epoch, decision.tick): (epoch, decision) for epoch, decision in decisions}
        in_order = sorted(known.values(), key=lambda each: each[1].tick) if file.info.simulated else known.values()
        found.decisions[agent] = list(in_order)
    return found
