"""How an agent decides, noted in its journal: the states that it used, their weights, and those that it left out. Pure.

A decision can be computed again from the own measurement and the neighbours' states, which the record has. So the
journal only names the states. In simulated time it does so where their ages in ticks, weights or reasons change.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf

from gridpeers.agents.agent import Agent
from gridpeers.wire.journal import Decision, JournalBuffer

_NOT_SATURATED = (0, 0)


class DecisionJournal:
    def __init__(self, agent: Agent, journal: JournalBuffer) -> None:
        self._agent, self.journal = agent, journal
        self._neighbours: Sequence[str] | None = None
        self._states: list[int | None] = []
        self._others: tuple[object, ...] = ()
        self._plain: Sequence[str] | None = None
        """In-neighbours of the last noted decision, if it used the states of the tick before, all with weight 1; else
        None."""
        self._weighs = not agent.weighs_alike

    def tick(self, tick: int, measurement: int, neighbours: Sequence[str]) -> bool:
        """Note the decision of a tick of simulated time if it was made otherwise than the last; return whether it was.

        `measurement` is the age of the own measurement in ticks; `neighbours` are the in-neighbours on the roster.
        """
        agent = self._agent
        heard, used = agent.heard, agent.around
        if neighbours is self._plain and not measurement and len(used) == len(neighbours):
            before = tick - 1  # mostly nothing has changed, and a look at the numbers suffices
            for name in neighbours:
                state = heard.get(name)
                if state is None or state.seq != before:
                    break
            else:
                if agent.saturated == _NOT_SATURATED:
                    return False
        states = [tick - heard[name].seq if name in heard else None for name in neighbours]
        unused = [] if len(used) == len(neighbours) else self._reasons(neighbours, states)
        weights = [neighbour.weight for neighbour in used] if self._weighs else []
        others = (measurement, unused, weights, agent.saturated)
        if states == self._states and neighbours == self._neighbours and others == self._others:
            return False
        self._neighbours, self._states, self._others = neighbours, states, others
        plain = states == [1] * len(states) and others == (0, [], [], _NOT_SATURATED) and not self._weighs
        self._plain = neighbours if plain else None
        if weights:
            weights = self._all_weights(neighbours)
        self.journal.add(Decision(tick, measurement, list(neighbours), states, unused, weights, agent.saturated))
        return True

    def realtime_tick(
        self,
        tick: int,
        measurement: int,
        ages: Mapping[str, float],
        max_age: float,
        at: float,
        before: tuple[float, float] | None,
    ) -> None:
        """Note a decision in real time.

        `tick` and `measurement` are the numbers of the own state and measurement, `ages` (s of run time) those of the
        last states, infinite if none was heard and not used beyond `max_age`; `at` is the own clock (s, monotonic) and
        `before` the set-points (W, V), None if the agent starts from those of its measurement.
        """
        agent = self._agent
        used = {neighbour.name for neighbour in agent.around}
        unused = [
            "" if name in used else "silent" if age == inf else "stale" if age > max_age else "island"
            for name, age in ages.items()
        ]
        self.journal.add(
            Decision(
                tick,
                measurement,
                list(ages),
                [agent.heard[name].seq if age < inf else None for name, age in ages.items()],
                unused if any(unused) else [],
                self._all_weights(tuple(ages)) if self._weighs else [],
                agent.saturated,
                at,
                [age if age < inf else None for age in ages.values()],
                list(before or ()),
            )
        )

    def _reasons(self, neighbours: Sequence[str], states: Sequence[int | None]) -> list[str]:
        agent, used = self._agent, {neighbour.name for neighbour in self._agent.around}
        reasons = []
        for name, state in zip(neighbours, states, strict=True):
            here = agent.in_service and agent.shares_island(name)
            reasons.append("" if name in used else "silent" if state is None else "stale" if here else "island")
        return reasons

    def _all_weights(self, neighbours: Sequence[str]) -> list[float]:
        weights = {neighbour.name: neighbour.weight for neighbour in self._agent.around}
        return [weights.get(name, 0.0) for name in neighbours]
