"""Faults on the link from the plant to an agent, in simulated time: an agent that has no measurement stands still."""

from __future__ import annotations

from typing import Any

import pytest
from msgspec.structs import replace

from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.emulation.link_data import EmulationConfig
from tests.toy.toy_configs import Schedule, toy_configs
from tests.toy.toy_plant import ToyPlant

Rows = list[tuple[float, ...]]


def rows_of(fault: dict[str, Any], schedule: Schedule = ()) -> Rows:
    """Rows of a run of three agents in which the measurements of inv2 have a fault."""
    netem = Netem(links=(Fault(on="plant -> inv2", **fault),))
    links = EmulationConfig(netem=netem, microgrids={f"inv{i}": "mg1" for i in range(1, 4)}).to_tree()
    plant, agents = toy_configs(3, end=2.0, schedule=schedule)
    agents = tuple(replace(agent, links=links) for agent in agents)
    rows: Rows = []
    outcome = run_inprocess(plant, agents, lambda message: rows.extend(message.rows), plant=ToyPlant(plant))
    assert outcome.broke == ""
    assert outcome.reproducible
    return rows


def P_set(rows: Rows, number: int, since: float, until: float) -> set[float]:
    """Set-points (W) that the plant held for an inverter."""
    return {row[5 + 6 * (number - 1)] for row in rows if since <= row[0] < until}


@pytest.mark.parametrize("fault", [{"cut": True}, {"loss": 1.0}, {"delay": 5.0}, {"cut": {"hold": True}}])
def test_an_agent_that_never_gets_a_measurement_stands_still(fault: dict[str, Any]) -> None:
    """Its inverter keeps its first set-points from the beginning to the end, and the others go on without it."""
    rows = rows_of(fault)

    assert P_set(rows, 2, 0.0, 9.0) == {50e3}
    assert len(P_set(rows, 1, 0.2, 2.0)) > 50
    assert rows[-1][1] == pytest.approx(60.0, abs=0.02)


def test_it_begins_with_the_first_measurement_that_comes_through() -> None:
    """With 0.3 s of delay it stands for 0.3 s, then moves."""
    rows = rows_of({"delay": 0.3})

    assert P_set(rows, 2, 0.0, 0.3) == {50e3}
    assert len(P_set(rows, 2, 0.5, 2.0)) > 30


def test_it_stands_still_again_once_none_has_come_for_a_while() -> None:
    """A link that is cut in the middle: 0.25 s later the agent ceases to act on the last error it knew of."""
    rows = rows_of({"cut": True, "from_s": 0.2})

    assert len(P_set(rows, 2, 0.2, 0.44)) > 10
    assert len(P_set(rows, 2, 0.5, 9.0)) == 1


def test_a_newcomer_stands_still_too_until_it_measures() -> None:
    """inv2 leaves at 0.4 s and is back at 0.6 s; its link is cut from then on."""
    rows = rows_of({"cut": True, "from_s": 0.5}, schedule=((0.4, "inv2", "leave"), (0.6, "inv2", "join")))
    held = P_set(rows, 2, 0.42, 2.0)

    assert len(P_set(rows, 2, 0.1, 0.4)) > 5
    assert len(held) == 1


def test_the_neighbours_of_a_standing_agent_do_not_use_what_it_says_for_the_lock_step() -> None:
    """They fare as if it said nothing: as if its states were cut, too."""
    standing = rows_of({"cut": True})
    netem = Netem(links=(Fault(on="plant -> inv2", cut=True), Fault(on="inv2 -> {inv1, inv3}", cut=True)))
    links = EmulationConfig(netem=netem, microgrids={f"inv{i}": "mg1" for i in range(1, 4)}).to_tree()
    plant, agents = toy_configs(3, end=2.0)
    silent: Rows = []
    muted = tuple(replace(agent, links=links) for agent in agents)
    run_inprocess(plant, muted, lambda message: silent.extend(message.rows), plant=ToyPlant(plant))

    assert standing == silent
