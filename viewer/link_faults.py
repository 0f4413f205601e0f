"""Faults of the emulated links of a record at a time, and what they did to the messages of the second before."""

from __future__ import annotations

from bisect import bisect_right
from collections import defaultdict
from contextlib import suppress
from functools import lru_cache

import msgspec

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
from gridpeers.wire.messages import LinkReport, LinkRequest


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
