"""One directed link: from a message's number, time and size to its fate. Pure.

Faults act in this order: **cut, partition, flap** (dropped, or kept until the link is up), **loss**, user-defined
faults in the order of their names, **rate** (a queue, tail drop), **slots**, **delay**, order (FIFO),
**duplicate**, **corrupt**. So a lost message takes no room in the queue. Which entries hold is decided by the time at
which the message was sent.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from gridpeers.netem.draws import Stream
from gridpeers.netem.fault_schedule import GATES, FaultSchedule
from gridpeers.netem.models.own_fault import DROPPED_BY_OWN, Judge, judge_of
from gridpeers.netem.schema.fault import Span
from gridpeers.netem.schema.pattern import Link
from gridpeers.wire.plugins.plugin import Plugin

NEVER = -math.inf

FOREVER = math.inf  # The delay of a message that nothing will ever let go


class Fate(NamedTuple):
    deliveries: tuple[tuple[float, int | None], ...] = ()
    """Of each copy the delay (s since it was sent; infinite while a cut without an end keeps it) and the bit that is
    flipped, None if none is."""
    reason: str = ""
    """Why it was dropped: "cut", "partition", "flap", "loss", "fault" (user-defined) or "queue"; empty if
    it was not."""
    held_until: float = NEVER
    """Until when (s of run time) a cut keeps it, infinite for a cut without an end; minus infinity if none does."""


DROPPED = {reason: Fate((), reason) for reason in (*GATES, "loss", DROPPED_BY_OWN, "queue")}


class Channel:
    """A directed link with its faults, by the seed of the run.

    Messages are judged in the order of their numbers, each once: a queue and FIFO remember. All else depends on the
    number and the time alone.

    Examples
    --------
    >>> from gridpeers.netem.schema.fault import Fault
    >>> fault = Fault(on="inv1 -> inv2", delay=0.25, loss=0.1)
    >>> channel = Channel(Link("inv1", "inv2"), fault.spans("inv1", "inv2", {}), seed=1)
    >>> channel.judge(0, 0.0, 100).deliveries
    ((0.25, None),)
    """

    def __init__(self, link: Link, spans: Iterable[Span], seed: int) -> None:
        self.link = link
        self.schedule = FaultSchedule(spans)
        self._seed = seed
        self._busy_until = self._last = NEVER
        """Until when the line of finite rate sends, and the latest arrival so far (s of run time)."""
        self._before_hold: tuple[float, float] | None = None
        self._samplers: dict[Span, Callable[..., Any]] = {}
        self._from, self._to = math.inf, -math.inf
        self.failures: list[str] = []
        """Sentences on user-defined faults that failed."""
        self.checksum = False
        """Whether the link finds flipped bits by itself, at the time of the message judged last."""

    @property
    def is_clear(self) -> bool:
        """Whether no fault can ever act."""
        return not self.schedule.spans

    def reschedule(self, schedule: FaultSchedule, *, rewind: bool) -> None:
        """Use another schedule for the messages that follow.

        With `rewind`, messages that a cut of the old schedule keeps will be judged again, in order and before any
        other: their effect on queue and order is undone.
        """
        self.schedule = schedule
        self._samplers = {span: sampler for span, sampler in self._samplers.items() if span in schedule.spans}
        self._from, self._to = math.inf, -math.inf
        if rewind and self._before_hold is not None:
            (self._busy_until, self._last), self._before_hold = self._before_hold, None

    def judge(self, seq: int, t: float, size: int) -> Fate:
        """Return the fate of a message: `seq` finds its random numbers, and `t`, when it was sent (s), its faults."""
        if not self._from <= t < self._to:
            self._enter(t)
        delay, held_until = 0.0, NEVER
        if self._gated:
            ready, reason = self.schedule.passes(t)
            if reason:
                return DROPPED[reason]
            if ready > t:
                if self._before_hold is None:
                    self._before_hold = (self._busy_until, self._last)
                if ready == FOREVER:
                    return Fate(((FOREVER, None),), "", FOREVER)
                delay, held_until = ready - t, ready
            else:
                self._before_hold = None
        if self._lost is not None and self._lost(seq):
            return DROPPED["loss"]
        for own in self._own:
            added = own(seq, t, size)
            if added is None:
                return DROPPED[DROPPED_BY_OWN]
            delay += added
        if self._rate is not None:
            through = self._rate.through(t + delay, self._busy_until, size)
            if through is None:
                return DROPPED["queue"]
            self._busy_until, delay = through, through - t
        if self._slots is not None:
            delay = self._slots.opens(t + delay) - t
        if self._delay is not None:
            delay += self._delay(seq)
        if t + delay >= self._last:
            self._last = t + delay
        elif self._fifo:
            delay = self._last - t
        if self._single:
            return Fate(((delay, None),), "", held_until)
        return Fate(self._copies(seq, size, delay), "", held_until)

    def _copies(self, seq: int, size: int, delay: float) -> tuple[tuple[float, int | None], ...]:
        bit = self._bit
        first = (delay, None if bit is None else bit(seq, 0, size))
        if self._copied is None or not self._copied(seq):
            return (first,)
        return (first, (delay + self._extra_delay, None if bit is None else bit(seq, 1, size)))

    def _enter(self, t: float) -> None:
        self._from, self._to, active = self.schedule.at(t)
        self._gated = any(kind in active for kind in GATES)
        if not self._gated:
            self._before_hold = None
        models = {kind: span.model for kind, span in active.items()}
        self._rate, self._slots = models.get("rate"), models.get("slots")
        own = sorted(kind for kind, span in active.items() if isinstance(span.model, Plugin))
        drawn = ("loss", "delay", "duplicate", "corrupt", *own)
        samplers = {kind: self._sampler(active[kind]) for kind in drawn if kind in active}
        self._lost, self._delay = samplers.get("loss"), samplers.get("delay")
        self._copied, self._bit = samplers.get("duplicate"), samplers.get("corrupt")
        self._own: list[Judge] = [samplers[name] for name in own]
        self._single = self._copied is None and self._bit is None
        self._fifo = "delay" in models and models["delay"].fifo
        self.checksum = "corrupt" in models and models["corrupt"].checksum
        self._extra_delay = models["duplicate"].extra_delay_s if "duplicate" in models else 0.0

    def _sampler(self, span: Span) -> Callable[..., Any]:
        """Return the sampler or judge of a fault; made once a span, so that chains go on from where they are."""
        if span not in self._samplers:
            stream = Stream(self._seed, *self.link, span.kind)
            if isinstance(span.model, Plugin):
                self._samplers[span] = judge_of(span.model, *self.link, stream, self.failures.append)
            else:
                self._samplers[span] = span.model.sampler(stream)
        return self._samplers[span]
