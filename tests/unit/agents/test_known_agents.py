"""Agents of one process share the roster and the evaluation of the graph's rule, but no message numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gridpeers.agents.agent import Agent
from gridpeers.agents.agent_config import Control
from gridpeers.agents.graphs import RosterGraph
from gridpeers.agents.roster_meeting import KnownAgents
from gridpeers.wire.messages import Prepare
from tests.toy.toy_configs import agent_config

NAMES = ("inv1", "inv2", "inv3", "inv4")
RING = Control(secondary="all", graph="ring")


def roster(number: int, *names: str) -> Prepare:
    return Prepare(sender="plant", epoch=1, seq=number, t=0.0, roster=names, instances=names)


def introduced(*names: str) -> KnownAgents:
    known = KnownAgents(RING)
    for name in names:
        known.members.appeared(name, name)
        known.members.meet(name, Agent(agent_config(name, RING)).nameplate)
    return known


def test_a_rule_is_evaluated_once_for_all_agents_of_a_roster() -> None:
    """Each agent of a ring gets its own two neighbours out of one evaluation."""
    calls: list[list[str]] = []

    def rule(members: Mapping[str, Any]) -> dict[str, set[str]]:
        calls.append(list(members))
        names = list(members)
        return {name: {names[i - 1]} for i, name in enumerate(names)}

    graph = RosterGraph(rule, dict.fromkeys(NAMES), "mine")  # type: ignore[arg-type]

    assert [graph.in_neighbours(name) for name in NAMES] == [("inv4",), ("inv1",), ("inv2",), ("inv3",)]
    assert calls == [list(NAMES)]


def test_a_member_without_a_nameplate_is_missing_to_all_but_itself() -> None:
    """A process whose token is gone, or another one than the roster's, is not met."""
    known = introduced("inv1", "inv2", "inv3")
    known.take(roster(0, *NAMES))
    known.members.vanished("inv2", "inv2")

    assert known.unmet("inv1") == ["inv2", "inv4"]
    assert known.unmet("inv2") == ["inv4"]
