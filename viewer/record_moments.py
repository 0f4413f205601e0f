"""What a record has at a time: rows of the plant, last decisions of agents, faults of emulated links."""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter, defaultdict
from collections.abc import Mapping
from contextlib import suppress
from functools import lru_cache
from typing import NamedTuple

import msgspec

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.netem.fault_schedule import Change, FaultSchedule, schedule_of
from gridpeers.netem.ledger import LinkCounts
from gridpeers.netem.schema.pattern import Link, links_among
from gridpeers.scenarios.emulation.link_data import (
    NO_MESSAGES,
    EmulationConfig,
    LinkCommand,
    LinkStatus,
    data_of,
    words,
)
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.viewer.run_view import FROZEN
from gridpeers.viewer.strips import LENGTH, Point, Sampler
from gridpeers.wire.journal import Decision
from gridpeers.wire.messages import LinkReport, LinkRequest, Measurement, State, Telemetry

LENGTHS = (LENGTH / 4.0, LENGTH / 2.0, LENGTH)
"""Lengths of strips (s): a record that is shorter than the last has more points a second."""

KEPT = 400  # Parts whose points are kept: two strips of a run in real time


class PlantRows:
    """Read rows by time; the configuration of each inverter gives per-unit values."""

    def __init__(self, record: RunRecord, configs: Mapping[str, AgentConfig]) -> None:
        self._record, self._index, self._configs = record, record.index, configs
        plant = record.info.plant
        self.longest_gap = max(FROZEN * max(1.0, plant.speed), 1.5 * plant.record_step)
        """Longest run time (s) between two rows. After it a row is missing, or in real time the plant is frozen."""
        self._rows_in = lru_cache(maxsize=8)(self._read_rows)
        self._points_in = lru_cache(maxsize=KEPT)(self._read_points)

    def last(self, t: float) -> tuple[tuple[str, ...], tuple[float, ...]] | None:
        """Return the inverters and the last row up to a run time (s); None if there is none shortly before."""
        found = None
        for part in self._index.near(t - max(1.0, self.longest_gap), t):
            inverters, rows = self._rows_in(part)
            at = bisect_right(rows, t + 1e-9, key=lambda row: row[0]) - 1
            if at >= 0 and (found is None or rows[at][0] > found[1][0]):
                found = inverters, rows[at]
        return found

    def points(self, since: float, until: float) -> list[Point]:
        """Return the points of the strips after a run time (s) up to another one, the last one exactly there."""
        length = next((length for length in LENGTHS if self._record.t_end <= length), LENGTHS[-1])
        points = [
            point
            for part in self._index.near(since, until)
            for point in self._points_in(part, length)
            if since + 1e-9 < point[0] <= until + 1e-9
        ]
        points.sort(key=lambda point: point[0])
        last = self.last(until)
        if last is not None and last[1][0] > max(since, points[-1][0] if points else since) + 1e-9:
            points += Sampler().points(last[0], (last[1],), self._configs)
        return points

    def _read_rows(self, part: int) -> tuple[tuple[str, ...], list[tuple[float, ...]]]:
        inverters: tuple[str, ...] = ()
        rows: list[tuple[float, ...]] = []
        for message in self._index.of_type("telemetry", Telemetry, (part,)):
            inverters = message.inverters
            rows += message.rows
        rows.sort(key=lambda row: row[0])
        return inverters, rows

    def _read_points(self, part: int, length: float) -> list[Point]:
        inverters, rows = self._rows_in(part)
        return [*Sampler(length).points(inverters, rows, self._configs)]


GONE = 0.5
"""Real time: time (s) without a decision after which an agent counts as not there, if that is 2.5 control periods."""


class AgentMoment(NamedTuple):
    name: str
    t: float
    island: str
    neighbours: tuple[str, ...]
    ages: tuple[float, ...]
    """Age (s of run time) of the last state of each; -1 if none was heard."""
    used: tuple[str, ...]
    idle: bool
    """It was paused, it had no measurement, or its law had failed."""
    known: bool = True
    """The record says how it decided; False behind the end of its journal, of which a killed process lacks a part."""


class AgentMoments:
    def __init__(self, record: RunRecord) -> None:
        self._index, self._info, self._entries = record.index, record.info, record.entries_of_decisions
        self._gone = max(GONE * max(1.0, self._info.plant.speed), 2.5 * self._info.T_c)
        self._sent_in = lru_cache(maxsize=64)(self._read_sent)

    def at(self, t: float) -> dict[str, AgentMoment]:
        if self._info.level == "physics":
            return {}
        found = (self._in_ticks if self._info.simulated else self._live)(t)
        return {moment.name: moment for moment in found}

    def sent(self, since: float, until: float) -> Counter[str]:
        counts: Counter[str] = Counter()
        for part in self._index.near(since, until):
            for name, times in self._sent_in(part).items():
                counts[name] += _between(times, since, until)
        return counts

    def _in_ticks(self, t: float) -> list[AgentMoment]:
        T_c = self._info.T_c
        last, moments = int(t / T_c + 1e-6), []
        for config in self._info.agents:
            for tick in range(last, max(-1, last - 2), -1):
                state = self._index.state(config.name, tick, tick * T_c)
                if state is not None:
                    moments.append(self._at_tick(state, tick * T_c))
                    break
        return moments

    def _at_tick(self, state: State, t: float) -> AgentMoment:
        name, measured = state.sender, self._index.measurement(state.sender, state.seq, t)
        if measured is None or not (state.idle or self._entries.know(state, t)):
            island = state.island if measured is None else measured.island
            return AgentMoment(name, t, island, (), (), (), idle=False, known=False)
        form, T_c = None if state.idle else self._entries.at(name, state.seq), self._info.T_c
        ages = () if form is None else tuple(-1.0 if lag is None else round(lag * T_c, 9) for lag in form.states)
        return _moment(name, t, measured.island, form, ages, idle=state.idle)

    def _live(self, t: float) -> list[AgentMoment]:
        gone = self._gone
        last: dict[str, tuple[Measurement, Decision]] = {}
        for part in self._index.near(t - gone, t):
            for journal, entry in self._index.part(part).entries:
                if isinstance(entry, Decision):
                    own = self._index.measurement(journal.sender, entry.measurement, journal.t)
                    before = last.get(journal.sender)
                    if own is None or not t - gone <= own.t <= t + 1e-9 or (before and before[0].t > own.t):
                        continue
                    last[journal.sender] = own, entry
        return [
            _moment(name, own.t, own.island, entry, tuple(-1.0 if age is None else age for age in entry.ages))
            for name, (own, entry) in last.items()
        ]

    def _read_sent(self, part: int) -> dict[str, list[float]]:
        times: dict[str, list[float]] = defaultdict(list)
        for (name, _), states in self._index.part(part).states.items():
            times[name] += [state.t for state in states[:1] if not (state.quiet or state.idle)]
        return {name: sorted(each) for name, each in times.items()}


def _moment(
    name: str, t: float, island: str, form: Decision | None, ages: tuple[float, ...], *, idle: bool = False
) -> AgentMoment:
    if form is None:
        return AgentMoment(name, t, island, (), (), (), idle)
    unused = form.unused or [""] * len(form.neighbours)
    used = tuple(each for each, why in zip(form.neighbours, unused, strict=False) if not why)
    neighbours = tuple(form.neighbours)
    return AgentMoment(name, t, island, neighbours, (*ages, *[-1.0] * len(neighbours))[: len(neighbours)], used, idle)


class LinkFaults:
    def __init__(self, record: RunRecord) -> None:
        self._index = record.index
        self._config = record.info.emulation
        self._parts, self._changes = -1, list[Change]()
        """Parts whose commands the schedules have, and what these changed."""
        self._into: dict[str, dict[str, FaultSchedule]] = {}
        """Schedule of each link that ever has a fault, by receiver and sender."""
        self._verdicts_in = lru_cache(maxsize=64)(self._read_verdicts)

    def into(self, t: float, window: float) -> dict[str, dict[str, LinkStatus]]:
        """Return the state of each link that has a fault at a run time (s), by receiver and sender.

        Its counts are those of messages that were sent in a window (s) before.
        """
        if self._config is None:
            return {}
        self._renew(self._config)
        counts = self._counts(t - window, t)
        found: dict[str, dict[str, LinkStatus]] = {}
        for dst, senders in self._into.items():
            for src, schedule in senders.items():
                active = schedule.at(t).active
                if active:
                    holds = tuple(words(kind, span.model) for kind, span in active.items())
                    found.setdefault(dst, {})[src] = LinkStatus(holds=holds, counts=counts.get((src, dst), NO_MESSAGES))
        return found

    def _renew(self, config: EmulationConfig) -> None:
        if self._parts == self._index.parts:
            return
        parts, self._parts = range(max(self._parts, 0), self._index.parts), self._index.parts
        known, began = len(self._changes), parts.start == 0
        for request in self._index.of_type("link_requests", LinkRequest, parts):
            with suppress(ValueError):  # of a later version, or damaged
                if request.seq > 0:
                    self._changes.append(LinkCommand.of_tree(request.link_command).at(request.t))
        if len(self._changes) == known and not began:
            return
        self._into = defaultdict(dict)
        for link in links_among(config.microgrids):
            schedule = schedule_of(Link(*link), config.netem, self._changes, config.microgrids)
            if schedule.spans:
                self._into[link[1]][link[0]] = schedule

    def _counts(self, since: float, until: float) -> dict[tuple[str, str], LinkCounts]:
        """Return the counts of the messages that were sent between two run times (s), the later one included."""
        counts: dict[tuple[str, str], LinkCounts] = {}
        for part in self._index.near(since, until):
            for link, (sent, dropped) in self._verdicts_in(part).items():
                before = counts.get(link, NO_MESSAGES)
                lost = before.dropped.get("", 0) + _between(dropped, since, until)
                number = before.sent + _between(sent, since, until)
                counts[link] = msgspec.structs.replace(NO_MESSAGES, sent=number, dropped={"": lost})
        return counts

    def _read_verdicts(self, part: int) -> dict[tuple[str, str], tuple[list[float], list[float]]]:
        found: dict[tuple[str, str], tuple[list[float], list[float]]] = defaultdict(lambda: ([], []))
        for report in self._index.of_type("link_reports", LinkReport, (part,)):
            try:
                traces = data_of(report).traces
            except ValueError:
                continue  # `RunRecord.links` notes it
            for trace in traces:
                sent, dropped = found[trace.src, trace.dst]
                sent += trace.t
                dropped += [t for t, outcome in zip(trace.t, trace.outcome, strict=True) if isinstance(outcome, str)]
        return {link: (sorted(sent), sorted(dropped)) for link, (sent, dropped) in found.items()}


def _between(times: list[float], since: float, until: float) -> int:
    return bisect_right(times, until + 1e-9) - bisect_right(times, since + 1e-9)
