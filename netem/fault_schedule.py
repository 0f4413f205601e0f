"""The faults of one link over time, in the order of their precedence, and what live changes make of them. Pure."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from functools import cached_property
from typing import NamedTuple

import msgspec

from gridpeers.netem.models import INSTANT
from gridpeers.netem.schema.fault import Fault, Span
from gridpeers.netem.schema.netem import Netem
from gridpeers.netem.schema.pattern import Link, links_among, parse

CUTS = ("cut", "partition")  # Kinds that let nothing pass as long as they hold

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
    >>> schedules.apply(Fault(on="inv1 -> inv2", cut=True, from_s=1.0))
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
