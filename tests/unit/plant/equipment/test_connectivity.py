"""Connected parts of a feeder, from its tables alone."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from gridpeers.plant.equipment.connectivity import Connectivity
from gridpeers.plant.tables import read_feeder


@pytest.mark.parametrize("turned", [False, True])
def test_a_switch_cuts_off_the_side_without_the_substation(turned: bool) -> None:
    """Opening 13-152 cuts off the microgrids, whichever of its buses is named first."""
    feeder = read_feeder("microgrid123")
    switch = next(switch for switch in feeder.switches if switch.name == "13-152")
    others = tuple(each for each in feeder.switches if each is not switch)
    if turned:
        switch = replace(switch, from_bus=switch.to_bus, to_bus=switch.from_bus)
    buses = Connectivity(replace(feeder, switches=(switch, *others))).cut_off(switch)

    assert {"152", "160", "300"} <= buses
    assert not {"150", "13", "1"} & buses


def test_a_single_phase_inverter_feeds_its_own_phase_alone() -> None:
    """Without the substation a GFM on phase C feeds the nodes of phase C; one of three phases feeds all."""
    feeder = replace(read_feeder("microgrid123"), source=None)
    graph = Connectivity(feeder)
    single = replace(feeder.inverters[0], phases="C")

    closed = graph.closed_at_start() - {"61-61s"}  # behind it a delta transformer joins the phases
    fed, dead = graph.fed(closed, [single])
    whole, _ = graph.fed(closed, feeder.inverters[:1])

    assert {phase for part in fed for _, phase in part} == {"C"}
    assert ("160", "A") in frozenset().union(*dead)
    assert {phase for part in whole for _, phase in part} == {"A", "B", "C"}
