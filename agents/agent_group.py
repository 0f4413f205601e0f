"""All agents of a run in simulated time, tick by tick, in one process and without messages. Pure.

Where no link is emulated and no agent joins, leaves or dies, messages decide nothing: at tick k an agent has the
measurement of tick k and the states of tick k-1 of its in-neighbours, however they came. So the agents of one process
can share one board with the last state of each, instead of a message, its checks and a copy for each link.
`agents.lockstep_agent` takes the same decisions with messages; a process has no other way.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from agents.agent import Agent
from agents.agent_config import AgentConfig
from agents.graphs import GraphError, RosterGraph
from agents.laws.law import Law
from agents.own_nameplate import check_nameplate
from agents.topology import rule_of, without_missing
from wire.messages import Measurement, State


class AgentGroup:
    """The agents of a run.

    Parameters
    ----------
    configs : Sequence[AgentConfig]
        Their configurations, in the order of the roster; all with the same rule.
    laws : Sequence[Law]
        Law of each.

    Raises
    ------
    ValueError
        If a value of a nameplate is out of bounds.
    """

    def __init__(self, configs: Sequence[AgentConfig], laws: Sequence[Law]) -> None:
        self._board: dict[str, State] = {}
        """Last state of each agent that its neighbours may use."""
        self._agents: dict[str, Agent] = {}
        for config, law in zip(configs, laws, strict=True):
            check_nameplate(config)
            self._agents[config.name] = Agent(config.by_own_clock(), law, self._board)
        self._neighbours: dict[str, tuple[str, ...]] = dict.fromkeys(self._agents, ())
        """In-neighbours of each agent at the next tick; at the first one, no state is there yet."""
        self._listens = self._meet(configs)
        self._notes_arrivals = any(agent.notes_arrivals for agent in self._agents.values())

    def _meet(self, configs: Sequence[AgentConfig]) -> dict[str, tuple[str, ...]]:
        """Let each agent meet its in-neighbours by the run's rule; return their names."""
        listens: dict[str, tuple[str, ...]] = dict.fromkeys(self._agents, ())
        nameplates = {name: agent.nameplate for name, agent in self._agents.items()}
        for control in [config.control for config in configs[:1]]:
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
        """Return the decision of each agent that has a measurement of this tick."""
        agents, neighbours = self._agents, self._neighbours
        states = [agents[measured.to].tick(measured, neighbours[measured.to]) for measured in measurements]
        told = {state.sender: state for state in states if not (state.idle or state.quiet)}
        self._board.update(told)
        if self._notes_arrivals:
            for name, agent in agents.items():
                for other in self._listens[name]:
                    if other in told:
                        agent.hear(told[other])
        self._neighbours = self._listens
        return states
