"""How agents decided, from their journals, with the messages that these name, also those that were lies.

In simulated time an entry holds until the next one of its agent, which may be minutes away: one pass over the file
notes the places of the entries. In real time each decision has its own entry.
"""

from __future__ import annotations

from bisect import bisect_right, insort
from collections.abc import Iterator
from contextlib import suppress
from functools import lru_cache, partial
from math import inf

from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig, nameplate_of
from gridpeers.agents.graphs import GraphError, in_neighbours, rule_of
from gridpeers.netem.liar import HeardFrom, last_before, lies_about
from gridpeers.netem.models import INSTANT
from gridpeers.scenarios.emulation.link_data import EmulationConfig
from gridpeers.scenarios.record.message_index import MessageIndex
from gridpeers.scenarios.record.record_info import RecordInfo
from gridpeers.scenarios.record.recorded_decision import Action, NeighbourInput, RecordedDecision
from gridpeers.wire.journal import Decision
from gridpeers.wire.messages import OFF, Journal, Measurement, Nameplate, State
from gridpeers.wire.timing import time_of

_REACH = 2.0  # Time (s) before the moment of a lie in which the true state is sought first

_NOTHING = Decision(0, 0, [], [], [], [])


class JournalEnds:
    """Up to when it is known how an agent decides in simulated time: a killed process has not sent its last part.

    With emulated links its journal comes in parts all the time. Without, each change has a part of its own at once.
    """

    def __init__(self, info: RecordInfo) -> None:
        self._in_parts = {config.name for config in info.agents if config.links}
        self._ends: dict[tuple[str, int], float] = {}
        """Run time of the last part (s), by agent and epoch."""

    def take(self, journal: Journal) -> None:
        one = journal.sender, journal.epoch
        self._ends[one] = max(journal.t, self._ends.get(one, 0.0))

    def know(self, agent: str, epoch: int, t: float) -> bool:
        """Return whether the record says how a process of an agent decided at a run time (s)."""
        return agent not in self._in_parts or t <= self._ends.get((agent, epoch), -inf) + 1e-9


class DecisionEntries:
    """The entries of simulated time: where each is in the file, and up to when the record has them."""

    def __init__(self, index: MessageIndex) -> None:
        self._index = index
        self._parts = 0
        self._places: dict[str, list[tuple[int, int]]] = {}
        """By agent: the first tick in each part of its journal that has entries, and the part of the file."""
        self._ends = JournalEnds(index.info)

    def at(self, agent: str, tick: int) -> Decision | None:
        """Return the entry that holds at a tick; None before the first one.

        Behind the end of a killed process's journal another one may have held: ask `know` first.
        """
        self._go_through()
        places = self._places.get(agent, [])
        place = bisect_right(places, (tick, self._parts)) - 1
        if place < 0:
            return None
        entries = self._index.part(places[place][1]).decisions[agent]
        return entries[max(each for each in entries if each <= tick)]

    def know(self, state: State, t: float) -> bool:
        """Return whether the record says how an agent decided a state of a run time (s)."""
        self._go_through()
        return self._ends.know(state.sender, state.epoch, t)

    def _go_through(self) -> None:
        for part in range(self._parts, self._index.parts):
            for journal in self._index.journals_in(part):
                self._ends.take(journal)
                entries = self._index.entries_in(journal)
                first = next((entry.tick for entry in entries if isinstance(entry, Decision)), None)
                if first is not None:
                    insort(self._places.setdefault(journal.sender, []), (first, part))
        self._parts = self._index.parts


class DecisionReader:
    def __init__(self, index: MessageIndex) -> None:
        self._index, self._info = index, index.info
        self._nameplates = {config.name: nameplate_of(config) for config in index.info.agents}
        self.entries = DecisionEntries(index)
        self._listens = lru_cache(maxsize=None)(self._all_in_neighbours)
        self._hearing = lru_cache(maxsize=None)(self._heard_from)

    def decisions(self, agent: str, since: float, until: float) -> Iterator[RecordedDecision]:
        config = self._info.agent(agent)
        if config is None:
            return iter(())
        return (self._in_ticks if self._info.simulated else self._in_real_time)(config, since, until)

    def _in_ticks(self, config: AgentConfig, since: float, until: float) -> Iterator[RecordedDecision]:
        name, T_c = config.name, self._info.T_c
        for index in self._index.near(since, until):
            states = self._index.part(index).states.items()
            own = [each for (sender, _), found in states if sender == name for each in found]
            for state in sorted(own, key=lambda each: each.seq):
                t = time_of(state.seq, T_c)
                if not since - 1e-9 <= t <= until + 1e-9 or not self.entries.know(state, t):
                    continue
                if (decision := self._at_tick(config, state, t)) is not None:
                    yield decision

    def _at_tick(self, config: AgentConfig, state: State, t: float) -> RecordedDecision | None:
        form = None if state.idle else self.entries.at(config.name, state.seq)
        form = form or _NOTHING
        age = form.measurement
        measured = self._index.measurement(config.name, state.seq - age, time_of(state.seq - age, self._info.T_c))
        if measured is None:
            return None
        measured = replace(measured, seq=state.seq, t=t) if age else measured
        return self._decision(config, state, measured, form, age)

    def _in_real_time(self, config: AgentConfig, since: float, until: float) -> Iterator[RecordedDecision]:
        name = config.name
        for index in self._index.near(since, until):
            for journal, entry in self._index.part(index).entries:
                if journal.sender != name or not isinstance(entry, Decision):
                    continue
                measured = self._index.measurement(name, entry.measurement, journal.t)
                state = self._index.state(name, entry.tick, journal.t)
                if measured is not None and state is not None and since - 1e-9 <= measured.t <= until + 1e-9:
                    yield self._decision(config, state, measured, entry)

    def _inputs(self, agent: str, form: Decision, tick: int, t: float) -> Iterator[NeighbourInput]:
        for i, name in enumerate(form.neighbours):
            number, age = form.states[i], form.ages[i] if i < len(form.ages) else None
            at = t - (age or 0.0)
            if self._info.simulated and number is not None:  # the entry has its age in ticks
                number = tick - number
                at = time_of(number, self._info.T_c)
            state, lie = None if number is None else self._index.state(name, number, at), ""
            if self._info.simulated and number is not None:
                age = t - (at if state is None else state.t)
            if state is not None and (heard := self._hearing(agent, name)) is not None:
                lie = heard.in_words(state.t)
                state = heard.told(state, partial(self._last_state_before, state))
            unused = form.unused[i] if i < len(form.unused) else ""
            weight = 0.0 if unused else form.weights[i] if i < len(form.weights) else 1.0
            plate = self._nameplate(name, state)
            yield NeighbourInput(
                nameplate=plate, state=state, number=number, age=age, weight=weight, unused=unused, lie=lie
            )

    def _heard_from(self, agent: str, sender: str) -> HeardFrom | None:
        config = self._info.agent(agent)
        if config is None or not config.links:
            return None
        netem = EmulationConfig.of_tree(config.links).netem
        lies = lies_about(netem, sender, agent)
        return HeardFrom(netem.seed, sender, agent, lies) if lies else None

    def _last_state_before(self, latest: State, t: float) -> State:
        """Return the last state that the process of a state sent up to a run time (s), or its first one."""
        found = self._states_of(latest, t - _REACH, t)
        if not found or found[0].t > t + INSTANT:
            found = self._states_of(latest, 0.0, latest.t)
        return last_before(found or [latest], t)

    def _states_of(self, latest: State, since: float, until: float) -> list[State]:
        """Return the states that receivers heard of the process of a state, in the parts with these run times (s)."""
        parts = (self._index.part(index).states.items() for index in self._index.near(since, until))
        sent = (each for part in parts for (sender, _), each in part if sender == latest.sender)
        heard = (each for states in sent for each in states if not (each.idle or each.quiet))
        own = (each for each in heard if each.epoch == latest.epoch and each.seq <= latest.seq)
        return sorted(own, key=lambda each: each.seq)

    def _nameplate(self, name: str, state: State | None) -> Nameplate:
        known = self._nameplates.get(name)
        if known is None:  # of an agent that no configuration names
            known = replace(next(iter(self._nameplates.values())), sender=name)
        return known if state is None or state.epoch == known.epoch else replace(known, epoch=state.epoch)

    def _decision(
        self, config: AgentConfig, state: State, measured: Measurement, form: Decision, age: int = 0
    ) -> RecordedDecision:
        neighbours = tuple(self._inputs(config.name, form, state.seq, measured.t))
        met, own = {each.name for each in neighbours}, self._own_before(config, state, form)
        action = _action(config, state, measured)
        return RecordedDecision(
            config=config,
            tick=state.seq,
            at=form.at,
            measurement=measured,
            measurement_age=age,
            neighbours=neighbours,
            not_met=tuple(name for name in self._listens(config.name) if name not in met),
            before=(measured.P_set, measured.V_set) if own is None or action != "law" else own,
            restarted=own is None,
            saturated=form.saturated if action == "law" else (0, 0),
            action=action,
            state=state,
        )

    def _own_before(self, config: AgentConfig, state: State, form: Decision) -> tuple[float, float] | None:
        """Return the agent's own set-points (W, V) before a decision; None where it starts, or starts again."""
        if self._info.clock == "realtime":
            return (form.before[0], form.before[1]) if len(form.before) == 2 else None
        last = self._index.state(config.name, state.seq - 1, time_of(state.seq - 1, self._info.T_c))
        if last is None or last.epoch != state.epoch or last.idle or last.island == OFF:
            return None
        return last.P_set, last.V_set

    def _all_in_neighbours(self, agent: str) -> tuple[str, ...]:
        config = self._info.agent(agent)
        with suppress(GraphError, ValueError):  # a rule of others that fails, or is not here
            if config is not None:
                return in_neighbours(config.control, agent, self._nameplates, rule_of(config.control))
        return ()


def _action(config: AgentConfig, state: State, measured: Measurement) -> Action:
    if state.idle:
        return "idle"
    if measured.island == OFF:
        return "off"
    takes_part = config.control.acts(config.name, config.kind)
    return "hold" if measured.grid_connected or not takes_part else "law"
