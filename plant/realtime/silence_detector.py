"""Detect silent agents: those that take part, but that the plant or a neighbour does not hear. Pure.

A frozen agent keeps its token for Zenoh's lease of 2 s, and two hosts that lose the path between them may both keep
theirs to the plant. The neighbours leave such a state out after `max_age`, which changes the run. The
plant detects the first by the age of the agent's last state, and the second by the ages in `AgentStatus`.

Ages count the time for which the plant itself listened: during a stall, states arrived that it has not read.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from gridpeers.wire.messages import AgentStatus

SETTLING = (
    0.1  # time (s, real time) for which a neighbour must be reported as not heard; a frozen one is detected meanwhile
)
ACQUAINTANCE = 1.0  # time (s, real time) after a join in which agents may not have heard each other yet
LISTENED = 2.0  # control periods between two steps of the plant in which it counts as listening; longer, it slept
RECENT = 3.0  # control periods within which the plant must have heard an agent that a neighbour does not hear


@dataclass
class _Agent:
    """An agent that takes part; times are s for which the plant has listened."""

    joined: float
    last: float  # when it was heard last, or joined
    holding: bool = False  # whether it reports that it has no measurement
    failed: bool = False  # whether its law has failed: it sends nothing more
    silent: bool = False
    unheard: dict[str, float] = field(default_factory=dict)
    """Neighbours that it does not hear, and from when on that is an event."""
    reported: set[str] = field(default_factory=set)  # neighbours whose silence has been an event


class SilenceDetector:
    """Keep the time at which each agent was heard last, and report silences.

    `max_age`: age (s of run time) beyond which a state is not used; `T_c`, `period`: control period (s of run time and
    of real time).
    """

    def __init__(self, max_age: float, T_c: float, period: float) -> None:
        self._max_age, self._period = max_age, period
        self._limit = max_age * period / T_c  # the same in real time (s)
        self._clock = 0.0  # time (s, real time) for which the plant has listened
        self._now: float | None = None  # time of the last update of the clock (s)
        self._agents: dict[str, _Agent] = {}

    def joined(self, name: str) -> None:
        self._agents[name] = _Agent(self._clock, self._clock)

    def heard(self, name: str, *, failed: bool = False) -> None:
        """Note a state that came off the wire, perhaps the last, by which an agent says that its law has failed."""
        if agent := self._agents.get(name):
            agent.last, agent.failed, agent.holding = self._clock, failed, False

    def forget(self, name: str) -> None:
        self._agents.pop(name, None)
        for agent in self._agents.values():
            agent.unheard.pop(name, None)
            agent.reported.discard(name)

    def reported(self, status: AgentStatus) -> None:
        """Note an agent's report of its neighbours; while it does not tick, it uses no state anyway."""
        if (agent := self._agents.get(status.sender)) is None:
            return
        if status.phase != "running":
            # before, it waits for its first measurement
            agent.holding = agent.holding or self._clock >= agent.joined + SETTLING
            return
        unheard: dict[str, float] = {}
        for name, age in zip(status.neighbours, status.ages, strict=False):
            if 0.0 <= age <= self._max_age or name not in self._agents:
                continue
            since = self._clock + SETTLING
            if age < 0.0:  # never heard since one of the two joined, or since the agent last stood still
                met = max(agent.joined, self._agents[name].joined) + ACQUAINTANCE
                since = max(since + self._limit, met)
            unheard[name] = agent.unheard.get(name, since)
        # a neighbour that is no longer named has lost its token there: it is not heard either
        lost = {name: at for name, at in agent.unheard.items() if name not in status.neighbours}
        agent.unheard = lost | unheard

    def take(self, now: float) -> Iterator[tuple[str, str]]:
        """Yield the agents whose silence begins or ends by this step of the plant, each with a sentence; `now` in s."""
        self._clock += 0.0 if self._now is None else min(max(0.0, now - self._now), LISTENED * self._period)
        self._now = now
        for name, agent in self._agents.items():
            was, agent.silent = agent.silent, self._clock - agent.last > self._limit
            if agent.silent and not was:
                why = "it says that it has no measurement" if agent.holding else "nothing comes from it"
                why = "as its law has failed" if agent.failed else why
                yield name, f"{name} is silent: no state for {self._max_age:g} s, {why}"
            elif was and not agent.silent:
                yield name, f"{name} is heard again"
                for other in self._agents.values():  # its state is on the way to those that did not hear it
                    if name in other.unheard:
                        other.unheard[name] = self._clock + SETTLING
        for name, agent in self._agents.items():
            yield from self._take_unheard(name, agent)

    def _take_unheard(self, name: str, agent: _Agent) -> Iterator[tuple[str, str]]:
        """Yield the neighbours that an agent no longer hears, or hears again, without silent agents."""
        back = sorted(agent.reported.difference(agent.unheard))
        agent.reported.intersection_update(agent.unheard)
        recent = self._clock - RECENT * self._period
        news = [
            other
            for other, at in agent.unheard.items()
            if at <= self._clock and other not in agent.reported
            if not self._agents[other].silent and self._agents[other].last >= recent
        ]
        agent.reported.update(news)
        if back:
            yield name, f"{name} hears {', '.join(back)} again"
        if news:
            others = ", ".join(news)
            them = "them" if len(news) > 1 else "it"
            yield name, f"{name} does not hear {others}: no state for {self._max_age:g} s, but the plant hears {them}"
