"""The faults of one link over time, in the order of their precedence."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable
from heapq import heappop, heappush
from itertools import pairwise
from typing import NamedTuple

from netem.models import INSTANT
from netem.schema.fault import Span

CUTS = ("cut", "partition")
"""Kinds that let nothing pass as long as they hold."""

GATES = (*CUTS, "flap")
"""Kinds that let nothing pass: all of them count at once, where of another kind only one entry can hold."""


class Segment(NamedTuple):
    """A stretch of time in which the same entries hold."""

    from_s: float
    """Its beginning (s of run time), early by an instant."""
    to_s: float
    """Its end (s), early by an instant."""
    active: dict[str, Span]
    """The entry that holds, by kind."""


class FaultSchedule:
    """Faults of one link.

    Parameters
    ----------
    spans : Iterable[Span]
        Faults, those of a scenario first. Where two of one kind hold at once, the later one in this order counts; in
        a scenario that is a problem, but a live command takes precedence over the scenario while it lasts.
    """

    def __init__(self, spans: Iterable[Span]) -> None:
        self.spans = tuple(span for span in spans if span.to_s > span.from_s)

    def at(self, t: float) -> Segment:
        """Return the entries that hold at time t (s)."""
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

    def with_spans(self, spans: Iterable[Span]) -> FaultSchedule:
        """Return the schedule with more entries, which take precedence."""
        return FaultSchedule((*self.spans, *spans))

    def healed(self, t: float, kinds: Collection[str] | None = None) -> FaultSchedule:
        """Return the schedule without the entries that hold at time t (s), from then on; later ones stay.

        Parameters
        ----------
        kinds : Collection[str], optional
            Kinds to be ended; without them, all.
        """
        return FaultSchedule(
            span._replace(to_s=t)
            if span.from_s <= t + INSTANT < span.to_s and (kinds is None or span.kind in kinds)
            else span
            for span in self.spans
        )

    def after(self, t: float) -> FaultSchedule:
        """Return the schedule without the entries that have ended by time t (s); it tells nothing of earlier times."""
        return FaultSchedule(span for span in self.spans if span.to_s > t)

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
