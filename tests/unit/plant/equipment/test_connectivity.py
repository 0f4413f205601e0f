"""Connected parts of a feeder, from its tables alone."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from plant.equipment.connectivity import Connectivity
from plant.tables import read_feeder


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
