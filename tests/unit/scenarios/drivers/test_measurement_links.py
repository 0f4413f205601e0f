"""Agents without measurements over bad links, and newcomers after a predecessor."""

from __future__ import annotations

from typing import Any

import pytest
from msgspec.structs import replace

from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem
from gridpeers.plant.plant_node import PlantNode
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.emulation.emulated_links import links_of
from gridpeers.scenarios.emulation.link_data import EmulationConfig
from tests.toy.toy_configs import Schedule, toy_configs
from tests.toy.toy_plant import ToyPlant
from tests.unit.plant.realtime.realtime_lab import Lab

Rows = list[tuple[float, ...]]


def emulated(*faults: Fault) -> dict[str, Any]:
    microgrids = {f"inv{i}": "mg1" for i in range(1, 4)}
    return EmulationConfig(netem=Netem(links=faults), microgrids=microgrids).to_tree()


def rows_of(*faults: Fault, schedule: Schedule = ()) -> Rows:
    plant, agents = toy_configs(3, end=2.0, schedule=schedule)
    agents = tuple(replace(agent, links=emulated(*faults)) for agent in agents)
    rows: Rows = []
    outcome = run_inprocess(plant, agents, lambda message: rows.extend(message.rows), plant=ToyPlant(plant))
    assert outcome.broke == ""
    assert outcome.reproducible
    return rows


MEASURED = "plant -> inv2"


def P_set(rows: Rows, number: int, since: float, until: float) -> set[float]:
    """Set-points (W) that the plant held for an inverter."""
    return {row[5 + 6 * (number - 1)] for row in rows if since <= row[0] < until}


@pytest.mark.parametrize("fault", [{"cut": True}, {"delay": 5.0}])
def test_an_agent_that_never_gets_a_measurement_stands_still(fault: dict[str, Any]) -> None:
    """Its inverter keeps its first set-points from the beginning to the end, and the others go on without it."""
    rows = rows_of(Fault(on=MEASURED, **fault))

    assert P_set(rows, 2, 0.0, 9.0) == {50e3}
    assert len(P_set(rows, 1, 0.2, 2.0)) > 50
    assert rows[-1][1] == pytest.approx(60.0, abs=0.02)


def test_a_newcomer_stands_still_too_until_it_measures() -> None:
    """inv2 leaves at 0.4 s and is back at 0.6 s; its link is cut from then on."""
    cut = Fault(on=MEASURED, cut=True, from_s=0.5)
    rows = rows_of(cut, schedule=((0.4, "inv2", "leave"), (0.6, "inv2", "join")))
    held = P_set(rows, 2, 0.42, 2.0)

    assert len(P_set(rows, 2, 0.1, 0.4)) > 5
    assert len(held) == 1


def test_the_neighbours_of_a_standing_agent_do_not_use_what_it_says_for_the_lock_step() -> None:
    """They fare as if it said nothing: as if its states were cut, too."""
    cut = Fault(on=MEASURED, cut=True)

    assert rows_of(cut) == rows_of(cut, Fault(on="inv2 -> {inv1, inv3}", cut=True))


LATE = emulated(Fault(on="inv2 -> plant", delay=0.3))  # States of inv2 take 0.3 s to the plant


class Holding(ToyPlant):
    """A plant that remembers whose set-points it was told to hold, and when."""

    held: list[tuple[float, str, float]]

    def hold(self, name: str, P_set: float, V_set: float) -> None:
        self.held = [*getattr(self, "held", []), (self._t, name, P_set)]
        super().hold(name, P_set, V_set)


def test_in_simulated_time_a_newcomer_is_not_given_its_predecessors_set_points() -> None:
    """inv2 leaves at 0.2 s and is back at 0.3 s; what its former life said until 0.2 s is due till 0.5 s."""
    plant, agents = toy_configs(3, end=1.0, schedule=((0.2, "inv2", "leave"), (0.3, "inv2", "join")))
    plant, agents = replace(plant, links=LATE), tuple(replace(agent, links=LATE) for agent in agents)
    toy = Holding(plant)
    outcome = run_inprocess(plant, agents, lambda telemetry: None, plant=toy)
    held = [t for t, name, _ in toy.held if name == "inv2"]

    assert outcome.broke == ""
    assert outcome.reproducible
    assert [t for t in held if 0.3 <= t < 0.6 - 1e-9] == []
    assert held[-1] == pytest.approx(0.98)


def test_in_real_time_a_ghost_is_not_held_and_does_not_block_the_newcomer() -> None:
    """The new process counts from 0, in an epoch that is even lower; only what it says is held, once it is there."""
    lab = Lab(3, end=9.0, links=LATE)
    config = lab.node.config
    toy = lab.toy = Holding(config)
    lab.node = PlantNode(config, toy, links_of("plant", LATE))
    lab.node.start(lab.now)

    lab.join("inv1", "inv2", "inv3", epoch=9)
    for k in range(30):
        lab.state("inv2", 1000 + k, 11e3, epoch=9)
        lab.step()
    lab.token("inv2", gone=True)
    lab.join("inv2", instance="b", epoch=4)
    t = lab.node.stepper.t
    for k in range(40):
        lab.state("inv2", k, 22e3, epoch=4)
        lab.step()
    after = [(at, P_set) for at, _, P_set in toy.held if at >= t]

    assert {P_set for _, P_set in after} == {22e3}
    assert after[0][0] == pytest.approx(t + 0.3, abs=0.05)
