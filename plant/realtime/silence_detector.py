"""Detect agents that take part and are not heard: not by the plant, or not by a neighbour. Pure.

A frozen agent keeps its token for Zenoh's lease of 2 s, and two hosts that lose the path between them may both keep
theirs to the plant. The neighbours leave such a state out after `max_age`, so the run is another one from then on. The
plant sees the first by the age of the agent's last state, and the second by the ages in `AgentStatus`.

Ages count the time for which the plant itself listened: while it stood still, states came that it has not read.
"""

from __future__ import annotations

from collections.abc import Iterator

from gridpeers.wire.messages import AgentStatus

SETTLING = 0.1
"""Time (s, wall) for which a neighbour must be reported as not heard before that is an event: meanwhile the plant
itself detects one that is frozen."""

ACQUAINTANCE = 1.0  # time (s, wall) after a join in which agents may not have heard each other yet

LISTENED = 2.0
"""Control periods between two steps of the plant that count as time in which it listened; what is beyond it slept."""

RECENT = 3.0  # control periods within which the plant must have heard an agent that a neighbour does not hear


class SilenceDetector:
    """Keep the time at which each agent was heard last, and report silences.

    `max_age`: age (s of run time) beyond which a state is not used; `T_c`: control period (s of run time); `period`:
    the same in wall time (s).
    """

    def __init__(self, max_age: float, T_c: float, period: float) -> None:
        self._max_age, self._period = max_age, period
        self._limit = max_age * period / T_c  # the same in wall time (s)
        self._clock = 0.0  # time (s, wall) for which the plant has listened
        self._now: float | None = None  # time of the last update of the clock (s)
        self._joined: dict[str, float] = {}
        self._last: dict[str, float] = {}  # time at which each agent was heard last, or joined
        self._holding: set[str] = set()  # agents that report that they have no measurement
        self._failed: set[str] = set()  # agents whose law has failed: they send nothing more
        self._silent: set[str] = set()
        self._unheard: dict[str, dict[str, float]] = {}
        """By agent, the neighbours that it does not hear, and the time from which on that is an event."""
        self._reported: dict[str, set[str]] = {}  # by agent, the neighbours whose silence has been an event

    def joined(self, name: str) -> None:
        self._joined[name] = self._last[name] = self._clock

    def heard(self, name: str, *, failed: bool = False) -> None:
        """Note a state that came off the wire, perhaps the last, by which an agent says that its law has failed."""
        (self._failed.add if failed else self._failed.discard)(name)
        self._last[name] = self._clock
        self._holding.discard(name)

    def forget(self, name: str) -> None:
        for known in (self._joined, self._last, self._unheard, self._reported):
            known.pop(name, None)
        self._silent.discard(name)
        self._holding.discard(name)
        self._failed.discard(name)
        for unheard in self._unheard.values():
            unheard.pop(name, None)
        for reported in self._reported.values():
            reported.discard(name)

    def reported(self, status: AgentStatus) -> None:
        """Note an agent's report of its neighbours; while it does not tick, it uses no state anyway."""
        if status.sender not in self._joined:
            return
        if status.phase != "running":
            if self._clock >= self._joined[status.sender] + SETTLING:  # before, it waits for its first measurement
                self._holding.add(status.sender)
            return
        unheard: dict[str, float] = {}
        before = self._unheard.get(status.sender, {})
        for name, age in zip(status.neighbours, status.ages, strict=False):
            if 0.0 <= age <= self._max_age or name not in self._joined:
                continue
            since = self._clock + SETTLING
            if age < 0.0:  # never heard since one of the two joined, or since the agent last stood still
                since = max(since + self._limit, self._acquainted(status.sender, name))
            unheard[name] = before.get(name, since)
        # a neighbour that is no longer named has lost its token there: it is not heard either
        named = set(status.neighbours)
        self._unheard[status.sender] = {name: at for name, at in before.items() if name not in named} | unheard

    def take(self, now: float) -> Iterator[tuple[str, str]]:
        """Yield the agents whose silence begins or ends by the plant's step at this time (s, wall), with a sentence."""
        self._clock += 0.0 if self._now is None else min(max(0.0, now - self._now), LISTENED * self._period)
        self._now = now
        for name, last in self._last.items():
            if self._clock - last > self._limit:
                if name not in self._silent:
                    self._silent.add(name)
                    yield name, f"{name} is silent: no state for {self._max_age:g} s, {self._why(name)}"
            elif name in self._silent:
                self._silent.discard(name)
                yield name, f"{name} is heard again"
        for name in self._unheard:
            yield from self._take_unheard(name)

    def _why(self, name: str) -> str:
        if name in self._failed:
            return "as its law has failed"
        return "it says that it has no measurement" if name in self._holding else "nothing comes from it"

    def _take_unheard(self, name: str) -> Iterator[tuple[str, str]]:
        """Yield the neighbours that an agent no longer hears, or hears again; one that nobody hears is silent."""
        unheard = {other: at for other, at in self._unheard[name].items() if other in self._last}
        reported = self._reported.setdefault(name, set())
        back = sorted(other for other in reported if other not in unheard and other in self._last)
        reported.intersection_update(unheard)
        recent = self._clock - RECENT * self._period
        news = [
            other
            for other, at in unheard.items()
            if at <= self._clock and other not in reported and other not in self._silent and self._last[other] >= recent
        ]
        reported.update(news)
        if back:
            yield name, f"{name} hears {', '.join(back)} again"
        if news:
            others = ", ".join(news)
            yield name, f"{name} does not hear {others}: no state for {self._max_age:g} s, though one came here"

    def _acquainted(self, *names: str) -> float:
        return max(self._joined[name] for name in names) + ACQUAINTANCE
