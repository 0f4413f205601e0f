"""The faults of one link over time, in the order of their precedence, and what live changes make of them. Pure."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from heapq import heappop, heappush
from itertools import pairwise
from typing import Any, NamedTuple

import msgspec

from gridpeers.netem.models import INSTANT
from gridpeers.netem.models.medium import Cut
from gridpeers.netem.schema.fault import Fault, Span
from gridpeers.netem.schema.netem import Netem
from gridpeers.netem.schema.pattern import Link, links_among, parse
from gridpeers.wire.plugins.plugin import Plugin

CUTS = ("cut", "partition")
"""Kinds that let nothing pass as long as they hold."""

GATES = (*CUTS, "flap")
"""Kinds that let nothing pass: all of them count at once, where of another kind only one entry can hold."""


class Segment(NamedTuple):
    from_s: float
    to_s: float
    active: dict[str, Span]


class FaultSchedule:
    """Faults of one link, those of a scenario first.

    Where two of one kind hold at once, the later one in this order counts: in a scenario that is a problem, but a live
    command takes precedence over the scenario while it lasts.
    """

    def __init__(self, spans: Iterable[Span]) -> None:
        self.spans = tuple(span for span in spans if span.to_s > span.from_s)

    @property
    def begins(self) -> float:
        """When its first fault begins (s of run time), infinity without one."""
        return min((span.from_s for span in self.spans), default=math.inf)

    def lately(self, t: float) -> FaultSchedule:
        """Return the schedule without the faults that had ended long before the time t (s) of a live change."""
        return FaultSchedule(span for span in self.spans if span.to_s > t - PAST)

    def at(self, t: float) -> Segment:
        now = t + INSTANT
        bounds = [bound for span in self.spans for bound in (span.from_s, span.to_s)]
        return Segment(
            max((bound for bound in bounds if bound <= now), default=-math.inf) - INSTANT,
            min((bound for bound in bounds if bound > now), default=math.inf) - INSTANT,
            {span.kind: span for span in self.spans if span.from_s <= now < span.to_s},
        )

    def passes(self, t: float) -> tuple[float, str]:
        """Return when a message of time t (s) gets past cuts, and "", or why it does not.

        The time is infinite for a message kept by a cut without an end. A kept message is let go when nothing keeps
        it any more, and meets the faults of that time; it is lost when a cut that loses begins meanwhile.
        """
        while True:
            down = [
                (span.model.down_until(t + INSTANT, span.from_s, span.to_s), span)
                for span in self.at(t).active.values()
                if span.kind in GATES
            ]
            closed = [(until, span) for until, span in down if until is not None]
            if not closed:
                return t, ""
            for _, span in closed:
                if not span.model.hold:
                    return t, span.kind
            until = min(until for until, _ in closed)
            for begins in sorted(span.from_s for span in self.spans if span.kind in CUTS and t < span.from_s < until):
                active = self.at(begins).active
                losing = [kind for kind in CUTS if kind in active and not active[kind].model.hold]
                if losing:
                    return begins, losing[0]
            if math.isinf(until):
                return until, ""
            t = until

    def healed(self, t: float, kinds: Collection[str] | None = None) -> FaultSchedule:
        """Return the schedule without the entries of some kinds, or all, that hold at time t (s); later ones stay."""
        return FaultSchedule(
            span._replace(to_s=t)
            if span.from_s <= t + INSTANT < span.to_s and (kinds is None or span.kind in kinds)
            else span
            for span in self.spans
        )

    def flat(self) -> tuple[Span, ...]:
        """Return the same without precedence: spans that do not overlap within a kind, by kind and time."""
        spans: list[Span] = []
        for kind in sorted({span.kind for span in self.spans}):
            own = [span for span in self.spans if span.kind == kind]
            bounds = sorted({bound for span in own for bound in (span.from_s, span.to_s)})
            coming = sorted(range(len(own)), key=lambda place: own[place].from_s, reverse=True)
            begun: list[int] = []  # negative places, as a heap: the latest, which takes precedence, is on top
            for start, end in pairwise(bounds):
                while coming and own[coming[-1]].from_s <= start:
                    heappush(begun, -coming.pop())
                while begun and own[-begun[0]].to_s <= start:
                    heappop(begun)
                if not begun:
                    continue
                model, last = own[-begun[0]].model, spans[-1] if spans else None
                # A flap counts from its own beginning, so pieces of one can be joined but never moved.
                if last and last.kind == kind and last.to_s == start and last.model == model:
                    spans[-1] = last._replace(to_s=end)
                else:
                    spans.append(Span(kind, start, end, model))
        return tuple(spans)


class Heal(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """Faults end on some links: those that hold at `from_s`; what a scenario has for later still comes."""

    on: str
    from_s: float
    kinds: tuple[str, ...] = ()
    """Kinds that end, e.g. ("cut",); empty is all."""


Change = Fault | Heal
"""A live change. A `Fault` takes precedence over what the scenario has of its kinds, until it ends."""


def changed(schedule: FaultSchedule, change: Change, link: Link, microgrids: Mapping[str, str]) -> FaultSchedule:
    """Return the schedule of a link after a change, the same object if the change is not about the link."""
    if isinstance(change, Fault):
        spans = change.spans(*link, microgrids)
        return FaultSchedule((*schedule.spans, *spans)) if spans else schedule
    if not parse(change.on).matches(*link, microgrids):
        return schedule
    return schedule.healed(change.from_s, change.kinds or None)


def schedule_of(link: Link, netem: Netem, changes: Iterable[Change], microgrids: Mapping[str, str]) -> FaultSchedule:
    """Return the schedule of one link: the scenario's entries, then the changes since, in that order."""
    schedule = FaultSchedule(netem.spans(link, microgrids))
    for change in changes:
        schedule = changed(schedule, change, link, microgrids)
    return schedule


PAST = 60.0
"""Time (s of run time) before a live change after which a fault that had ended is forgotten: there may be thousands. A
change takes effect at its own time, and commands may arrive slightly out of order."""


class LinkSchedules:
    """Schedules of all links of a run as live changes come, each change taken up once.

    Only the times of changes to come are looked up.

    Examples
    --------
    >>> schedules = LinkSchedules(Netem(), {"inv1": "MG1", "inv2": "MG1"})
    >>> schedules.apply(Fault(on="inv1 -> inv2", cut=Cut(), from_s=1.0))
    >>> [kind for kind in schedules.of(Link("inv1", "inv2")).at(2.0).active]
    ['cut']
    """

    def __init__(self, netem: Netem, microgrids: Mapping[str, str]) -> None:
        self._netem, self._microgrids = netem, microgrids

    @cached_property
    def _schedules(self) -> dict[Link, FaultSchedule]:
        return {link: schedule_of(link, self._netem, (), self._microgrids) for link in links_among(self._microgrids)}

    def apply(self, change: Change) -> None:
        for link, before in self._schedules.items():
            if (after := changed(before, change, link, self._microgrids)) is not before:
                self._schedules[link] = after.lately(change.from_s)

    def of(self, link: Link) -> FaultSchedule:
        """Return the schedule of a link after all changes so far."""
        return self._schedules[link]


def replayed(netem: Netem, changes: Sequence[Change], microgrids: Mapping[str, str]) -> Iterator[Fault]:
    """Yield entries that do without changes what a scenario did with its changes, those of one receiver after another.

    Links of one receiver that fared alike share an entry. A partition becomes a cut; one by islands is left out, as its
    links are not known here. The faults of one receiver are in memory at a time: of a long run there are thousands.
    """
    links = links_among(microgrids)
    for dst in dict.fromkeys(link.dst for link in links):
        alike: dict[tuple[Span, ...], list[str]] = {}
        for link in links:
            if link.dst == dst:
                spans = schedule_of(link, netem, _about(link, changes, microgrids), microgrids).flat()
                alike.setdefault(spans, []).append(link.src)
        for spans, sources in alike.items():
            on = f"{sources[0]} -> {dst}" if len(sources) == 1 else f"{{{', '.join(sources)}}} -> {dst}"
            for span in _cuts_joined(spans):
                to_s = None if math.isinf(span.to_s) else span.to_s
                yield Fault(on=on, from_s=span.from_s, to_s=to_s, **_entry(span))


def _about(link: Link, changes: Sequence[Change], microgrids: Mapping[str, str]) -> list[Change]:
    """Return the changes that are about a link: thousands of them have few different patterns, each matched once."""
    matches = {on: parse(on).matches(*link, microgrids) for on in {change.on for change in changes}}
    return [change for change in changes if matches[change.on]]


def _entry(span: Span) -> dict[str, Any]:
    if isinstance(span.model, Plugin):
        return {"own": (span.model,)}
    return {"cut" if span.kind == "partition" else span.kind: span.model}


def _cuts_joined(spans: Iterable[Span]) -> list[Span]:
    """Return the spans with cuts and partitions as one kind, so that no two entries of a link overlap."""
    both = [span for span in spans if span.kind in CUTS]
    rest = [span for span in spans if span.kind not in CUTS]
    # where a cut that keeps meets one that loses, messages are lost: the latter comes last, and so takes precedence
    both.sort(key=lambda span: not span.model.hold)
    joined = FaultSchedule(Span("cut", span.from_s, span.to_s, Cut(hold=span.model.hold)) for span in both).flat()
    return [*rest, *joined]
