"""Open a record and ask it: `RunRecord`.

All times are run time (s) unless a name says otherwise. Everything is read when it is asked for, a second at a time,
so a record of hours takes no more memory than a short one. Nothing in the file is trusted: what cannot be read is left
out, and `damage` tells so.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from math import inf, isnan
from numbers import Real
from pathlib import Path
from typing import TypeVar

from gridpeers.netem.ledger import LinkCounts, LinkTrace
from gridpeers.scenarios.console import short
from gridpeers.scenarios.emulation.link_data import LinkReportData, data_of
from gridpeers.scenarios.record.decision_reader import DecisionReader
from gridpeers.scenarios.record.message_index import MessageIndex
from gridpeers.scenarios.record.record_file import RecordFile, RecordFileError, record_path
from gridpeers.scenarios.record.recorded_decision import RecordedDecision
from gridpeers.scenarios.results.history import History
from gridpeers.scenarios.results.record import canonical
from gridpeers.wire.journal import Entry
from gridpeers.wire.messages import LinkReport, Message, PlantEvent, Telemetry

__all__ = ["RecordFileError", "RunRecord"]

T = TypeVar("T")
M = TypeVar("M", bound=Message)


class RunRecord:
    """The record of one case, opened by `RunRecord.open`: its file, and its run (`info`)."""

    def __init__(self, file: RecordFile) -> None:
        self._file = file
        self.path, self.info = file.path, file.info
        self.index = MessageIndex(file)
        """What is in each part of the file, for readers that go through it by parts."""
        self._decisions = DecisionReader(self.index)
        self.entries_of_decisions = self._decisions.entries
        """How agents decided, and up to when the record has it, for readers that look at all agents."""

    @classmethod
    def open(cls, path: str | Path, case: str = "") -> RunRecord:
        """Open a record: the file run.mcap, the folder of a case, or that of a run with one case or the case named.

        Raise RecordFileError if there is none, it is no record of gridpeers, or from a later version.
        """
        return cls(RecordFile(record_path(path, case)))

    @property
    def complete(self) -> bool:
        """True if the record was closed properly. If not, its end is missing: at most the last second."""
        return self._file.complete

    def refresh(self) -> None:
        """Take in what was written since, of a run that is still recorded."""
        self._file.refresh()

    @property
    def damage(self) -> tuple[str, ...]:
        """Sentences on what could not be read so far, and on the end of the file if it is cut off or damaged."""
        return tuple(dict.fromkeys((*self._file.damage, *self.index.damage)))

    @property
    def t_end(self) -> float:
        """Latest run time in the record (s)."""
        return self._file.t_end

    @property
    def agents(self) -> tuple[str, ...]:
        """Names of all configured agents, also of those that join later."""
        return self.info.agent_names

    @property
    def outcome(self) -> str | None:
        """Why the run broke; empty after a good end; None if the record ends before the run."""
        last = _last(self.telemetry(since=max(0.0, self.t_end - 1.0)))
        return last.outcome if last is not None and last.final else None

    def telemetry(self, *, since: float = 0.0, until: float = inf) -> Iterator[Telemetry]:
        """Yield the plant's telemetry: rows and events, in the order of time.

        Messages have the rows of a while: those between two run times (s) come with others around them.
        """
        _check_times(since=since, until=until)
        return self.index.of_type("telemetry", Telemetry, self.index.near(since, until))

    def physics(self) -> History:
        """Return the rows of the plant, to the last bit; RecordFileError if there are none."""
        rows, inverters = bytearray(), self.info.inverters
        for message in self.telemetry():
            inverters = message.inverters
            rows += canonical(message.rows)
        if not rows:
            raise RecordFileError(f"{self.path}: it has no rows: it ends before the run began")
        return History.of(inverters, rows)

    def events(self) -> tuple[PlantEvent, ...]:
        """Return the events of the plant, the roster and the links, in the order of time."""
        return tuple(event for message in self.telemetry() for event in message.events)

    def messages(
        self, kind: type[M], sender: str | None = None, *, since: float = 0.0, until: float = inf
    ) -> Iterator[M]:
        """Yield the messages of a type as they were sent, each once, in the order of the record.

        Run times (s) include the limits. `gridpeers.wire.messages.Message` is the type of all.
        """
        _check_times(since=since, until=until)
        return self.index.messages(kind, sender, since, until)

    def entries(self, node: str, *, since: float = 0.0, until: float = inf) -> Iterator[Entry]:
        """Yield all entries of the journal of an agent, or of "plant": tokens, process events and the rest.

        An entry has no run time of its own: `since` and `until` (s) choose the parts of the journal, of 0.2 s or so.
        """
        _check_times(since=since, until=until)
        return self.index.entries(node, since, until)

    def links(self) -> Iterator[LinkTrace]:
        """Yield the verdicts of the emulated links, as in links.csv: in parts of one link, as they were reported."""
        for _, data in self._link_reports():
            yield from data.traces

    def link_counts(self) -> dict[tuple[str, str], LinkCounts]:
        """Return the counts of the messages of each emulated link, by sender and receiver, at their last report."""
        return {(src, receiver): of for receiver, data in self._link_reports() for src, of in data.counts.items()}

    def _link_reports(self) -> Iterator[tuple[str, LinkReportData]]:
        for report in self.index.of_type("link_reports", LinkReport):
            try:
                yield report.sender, data_of(report)
            except ValueError:  # the report of a later version, or a damaged one
                self.index.note_damage(f"a report on the links into {report.sender} cannot be read")

    def decisions(self, agent: str, *, since: float = 0.0, until: float = inf) -> Iterator[RecordedDecision]:
        """Yield the decisions of an agent between two run times (s), the limits included, in the order of time."""
        self._require(agent)
        _check_times(since=since, until=until)
        if self.info.level == "physics":
            raise RecordFileError(f'{self.path}: it has no decisions: the run was recorded with record = "physics"')
        return self._decisions.decisions(agent, since, until)

    def decision(self, agent: str, t: float) -> RecordedDecision:
        """Return the decision of an agent that was in force at a run time (s): its last one up to then.

        Raise RecordFileError if there is none, or the record lacks it.
        """
        _check_times(t=t)
        self._require_time(t)
        back, found = 1.0, None
        while found is None and back < 4.0 * (t + 1.0):
            found = _last(self.decisions(agent, since=max(0.0, t - back), until=t + 1e-9))
            back *= 4.0
        self._require_time(t)  # the file may have turned out to be damaged
        tick = int(t / self.info.T_c + 1e-6)
        state = self.index.state(agent, tick, t) if self.info.simulated else None
        if state is not None and not (state.idle or self.entries_of_decisions.know(state, state.t)):
            last = "" if found is None else f"; its last decision in the record is at t = {found.t:.2f} s"
            raise RecordFileError(
                f"{self.path}: it lacks the decision of {agent} at t = {t:g} s: its journal ends before{last}"
            )
        if found is None:
            first = next(self.decisions(agent), None)
            if first is None:
                raise RecordFileError(f"{self.path}: it has no decision of {agent}")
            raise RecordFileError(
                f"{self.path}: {agent} made no decision by t = {t:g} s; its first decision is at t = {first.t:.2f} s"
            )
        return found

    def _require_time(self, t: float) -> None:
        if not 0.0 <= t <= self.t_end + self.info.T_c:
            raise RecordFileError(
                f"{self.path}: t = {t:g} s is outside of the record, which has 0 to {self.t_end:.2f} s"
                + "".join(f": {why}" for why in self._file.damage)
            )

    def _require(self, agent: object) -> None:
        if agent != "plant" and agent not in self.agents:
            raise RecordFileError(f"{self.path}: there was no agent {agent!s:.64}; agents are {short(self.agents)}")


def _check_times(**times: object) -> None:
    for name, t in times.items():
        if not isinstance(t, Real) or isnan(t):
            raise RecordFileError(f"{name}: needs a run time in s, as 4.3, got {t!r:.60}")


def _last(items: Iterable[T]) -> T | None:
    return next(iter(deque(items, maxlen=1)), None)
