from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Literal

import pytest
from msgspec.structs import replace

from gridpeers.agents.agent import Agent
from gridpeers.agents.agent_config import Control, DegradedCommunication
from gridpeers.agents.laws.law import Law, Neighbour, Own, SetPoints
from gridpeers.wire.messages import OFF, Nameplate
from tests.toy import toy_messages
from tests.toy.toy_configs import ALL_FULL, agent_config
from tests.unit.agents.law_steps import P_set_step, V_set_step

ROSTER = ("inv1", "inv2", "inv3")


measurement = partial(toy_messages.measurement, P=90e3, Q=20e3, V=271.46, f=59.7, roster=ROSTER)
state = partial(toy_messages.state, P_set=60e3)


def plate(name: str, *, epoch: int = 1, P_rated: float = 100e3) -> Nameplate:
    return replace(Agent(agent_config(name)).nameplate, epoch=epoch, P_rated=P_rated)


def met(control: Control = ALL_FULL, name: str = "inv1") -> Agent:
    agent = Agent(agent_config(name, control))
    for other in ROSTER:
        if other != name:
            agent.meet(plate(other))
    return agent


def test_a_tick_is_the_law_in_per_unit() -> None:
    """Messages are in SI units: the set-points are those of the law, times the own bases."""
    agent = met()
    agent.meet(plate("inv3", P_rated=50e3))
    agent.hear(state("inv2", P_set=60e3, Q=10e3))
    agent.hear(state("inv3", P_set=40e3, Q=20e3))

    decided = agent.tick(measurement(1), agent.in_neighbours(ROSTER))

    gains = ALL_FULL.gains
    P = P_set_step(0.5, 0.01 * (0.6 + 0.8) / 2, 2.0, -0.3 / 60.0, leader=True, m_p=0.01, gains=gains, T=0.02)
    V = V_set_step(1.0, 0.05 * 0.2, 0.05 * (0.1 + 0.4) / 2, 2.0, 0.98, leader=True, gains=gains, T=0.02)
    assert decided.P_set == pytest.approx(P * 100e3, rel=1e-12)
    assert decided.V_set == pytest.approx(V * 277.0, rel=1e-12)
    assert (decided.sender, decided.seq, decided.t, decided.Q) == ("inv1", 1, 0.02, 20e3)


def test_on_hold_an_agent_follows_the_plant() -> None:
    """While grid-connected the set-points are the plant's, so the law starts from them without a bump."""
    agent = met(Control(secondary="all", graph="none"))
    held = agent.tick(measurement(0, grid_connected=True, P_set=64.7e3, V_set=280.0))

    first = agent.tick(measurement(1, P_set=1.0, V_set=1.0, f=60.0, V=277.0, Q=0.0))

    assert (held.P_set, held.V_set) == (64.7e3, 280.0)
    assert (first.P_set, first.V_set) == (pytest.approx(64.7e3), pytest.approx(280.0))


def test_an_agent_out_of_service_is_idle_and_restarts_from_the_held_set_points() -> None:
    """The agent is idle while the inverter is off; then the law starts from the held set-points."""
    agent = met()
    agent.tick(measurement())
    off = agent.tick(measurement(1, island=OFF, V=0.0, f=0.0, P=0.0, Q=0.0, P_set=0.0, V_set=277.0))

    back = agent.tick(measurement(2, P_set=5e3, V_set=270.0, f=60.0, V=277.0))

    assert (off.P_set, off.V_set, off.island) == (0.0, 277.0, OFF)
    assert (back.P_set, back.V_set) == (5e3, 270.0)


@pytest.mark.parametrize("islands", ["switches", "frequency", "ignored"])
def test_a_neighbour_that_is_out_of_service_is_left_out(islands: Literal["switches", "frequency", "ignored"]) -> None:
    """Its 0 var would bias the others; the rule holds for islands by name and by frequency."""
    control = replace(ALL_FULL, degraded_communication=DegradedCommunication(islands=islands))
    agent = met(control)
    agent.hear(state("inv2"))
    agent.hear(replace(state("inv3", P_set=0.0, Q=0.0), island=OFF))

    assert agent.shares_island("inv2")
    assert not agent.shares_island("inv3")


def test_a_law_that_changes_what_a_neighbour_shares_fails() -> None:
    """Agents of one process read the same state, so a change by a law would couple them."""

    class Touching(Law):
        def step(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> SetPoints:
            neighbours[0].shared["x"] = 1.0  # type: ignore[index]
            return SetPoints(own.P_set, own.V_set)

    agent = Agent(met().config, Touching())
    agent.meet(plate("inv2"))
    told = replace(state("inv2"), shared={"x": 0.5})
    agent.hear(told)

    decided = agent.tick(measurement(1), ("inv2",))

    assert "does not support item assignment" in decided.fault
    assert told.shared == {"x": 0.5}
