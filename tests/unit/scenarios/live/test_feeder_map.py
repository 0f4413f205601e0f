"""The one-line diagram that a plant hands out."""

from __future__ import annotations

import msgspec

from gridpeers.plant.equipment.named_loads import named_loads
from gridpeers.scenarios.live.feeder_map import FeederMap, feeder_map, read_feeder_map
from gridpeers.scenarios.live.live_options import LiveOptions, configure
from gridpeers.scenarios.schema import load_scenario


def test_loads_are_on_the_map_as_the_run_has_them() -> None:
    """Each load of the feeder at its bus, with the scenario's factor on it."""
    scenario, feeder = load_scenario("islanding")
    twice = msgspec.structs.replace(scenario, plant=msgspec.structs.replace(scenario.plant, load_factor=2.0))
    plant, _ = configure(twice, feeder, LiveOptions(run="lab"), "tcp/127.0.0.1:7447")
    diagram = msgspec.convert(plant.feeder_map, FeederMap)

    assert (diagram.scenario, diagram.case) == ("islanding", "IV")
    assert {load.name: (diagram.buses[load.bus][0], complex(load.P, load.Q)) for load in diagram.loads} == {
        name: (load.bus, 2.0 * load.S) for name, load in named_loads(feeder).items()
    }


def test_a_load_at_a_bus_that_is_not_there_is_no_map() -> None:
    """What comes over the network is not believed."""
    diagram = feeder_map(load_scenario("islanding")[1])
    wrong = msgspec.structs.replace(diagram.loads[0], bus=len(diagram.buses))

    assert read_feeder_map(msgspec.json.encode(diagram)) == diagram
    assert read_feeder_map(msgspec.json.encode(msgspec.structs.replace(diagram, loads=(wrong,)))) is None
