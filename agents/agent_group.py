"""All agents of a run in simulated time, tick by tick, in one process and without messages. Pure.

Where no link is emulated and no agent joins, leaves or dies, messages decide nothing: at tick k an agent has the
measurement of tick k and the states of tick k-1 of its in-neighbours, however they came. So the agents of one process
can share one board with the last state of each, instead of a message, its checks and a copy for each link.
`gridpeers.agents.agent_node` takes the same decisions with messages; a process has no other way.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

from gridpeers.agents.agent import Agent
from gridpeers.agents.agent_config import AgentConfig, check_nameplate
from gridpeers.agents.decision_journal import DecisionJournal
from gridpeers.agents.graphs import GraphError, RosterGraph, rule_of, without_missing
from gridpeers.agents.laws.law import Law
from gridpeers.wire.journal import JournalBuffer
from gridpeers.wire.messages import Journal, Measurement, State


class AgentGroup:
    """The agents of a run, in the order of the roster; all with the same rule, each with its law.

    Raise ValueError if a value of a nameplate is out of bounds.
    """

    def __init__(self, configs: Sequence[AgentConfig], laws: Sequence[Law]) -> None:
        self._board: dict[str, State] = {}
        self._agents: dict[str, Agent] = {}
        for config, law in zip(configs, laws, strict=True):
            check_nameplate(config)
            self._agents[config.name] = Agent(config.by_own_clock(), law, self._board)
        self._neighbours: dict[str, tuple[str, ...]] = dict.fromkeys(self._agents, ())
        """In-neighbours of each agent at the next tick; at the first one, no state is there yet."""
        self._listens = self._meet(configs)
        self._journals: dict[str, DecisionJournal] = {}
        self._parts: Counter[str] = Counter()
        self._changed: list[State] = []
        if any(config.record != "physics" for config in configs):
            self._journals = {name: DecisionJournal(agent, JournalBuffer()) for name, agent in self._agents.items()}
        self._notes_arrivals = any(agent.notes_arrivals for agent in self._agents.values())

    def _meet(self, configs: Sequence[AgentConfig]) -> dict[str, tuple[str, ...]]:
        """Let each agent meet its in-neighbours by the run's rule; return their names."""
        listens: dict[str, tuple[str, ...]] = dict.fromkeys(self._agents, ())
        nameplates = {name: agent.nameplate for name, agent in self._agents.items()}
        if not configs:
            return listens
        control = configs[0].control
        graph = RosterGraph(rule_of(control), nameplates, control.graph)
        for name, agent in self._agents.items():
            try:
                listens[name] = without_missing(control, name, graph.in_neighbours(name))
            except GraphError as error:
                agent.graph_error = str(error)
            for other in listens[name]:
                agent.meet(nameplates[other])
        return listens

    def tick(self, measurements: Iterable[Measurement]) -> list[State]:
        agents, neighbours = self._agents, self._neighbours
        states = [agents[measured.to].tick(measured, neighbours[measured.to]) for measured in measurements]
        if journals := self._journals:
            self._changed += [s for s in states if journals[s.sender].tick(s.seq, 0, neighbours[s.sender])]
        told = {state.sender: state for state in states if not (state.idle or state.quiet)}
        self._board.update(told)
        if self._notes_arrivals:
            for name, agent in agents.items():
                for other in self._listens[name]:
                    if other in told:
                        agent.hear(told[other])
        self._neighbours = self._listens
        return states

    def take_journals(self) -> tuple[Journal, ...]:
        """Take out the parts of all journals since the last call; mostly there are none."""
        if not self._changed:
            return ()
        changed, self._changed = self._changed, []
        journals = []
        for state in changed:
            name = state.sender
            for data in self._journals[name].journal.take_parts():
                journals.append(Journal(sender=name, epoch=state.epoch, seq=self._parts[name], t=state.t, data=data))
                self._parts[name] += 1
        return tuple(journals)
