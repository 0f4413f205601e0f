from gridpeers.plant.network import Network
from tests.unit.plant.networks import PAPER_ISLANDS, opened, zones


def test_all_is_one_island_at_first(network: Network) -> None:
    """Grid-connected, every bus hangs together."""
    assert network.islands(network.closed0) == (frozenset(bus.name for bus in network.feeder.buses),)


def test_event_1_islands_the_microgrids(network: Network) -> None:
    """Opening 13-152 leaves 1-34 with the substation and islands everything beyond."""
    assert network.islands(opened(network, "13-152")) == (
        zones(network, "rest"),
        zones(network, "passive", "MG1", "MG2", "MG3"),
    )


def test_event_2_drops_the_passive_zone(network: Network) -> None:
    """Opening 60-160 as well leaves the passive zone dead and the three microgrids together."""
    assert set(network.islands(opened(network, "13-152", "60-160"))) == {
        zones(network, "rest"),
        zones(network, "passive"),
        zones(network, "MG1", "MG2", "MG3"),
    }


def test_opening_60_160_alone_keeps_the_passive_zone_on_the_grid(network: Network) -> None:
    """With 13-152 closed, opening 60-160 leaves the passive zone with the substation."""
    assert set(network.islands(opened(network, "60-160"))) == {
        zones(network, "rest", "passive"),
        zones(network, "MG1", "MG2", "MG3"),
    }


def test_three_microgrids(network: Network) -> None:
    """sw1_2 and sw2_3 split the island into MG1 with the passive zone, MG2 and MG3, one GFM in each."""
    islands = network.islands(opened(network, *PAPER_ISLANDS))

    assert set(islands) == {
        zones(network, "rest"),
        zones(network, "passive", "MG1"),
        zones(network, "MG2"),
        zones(network, "MG3"),
    }
    grid_forming = {inverter.bus for inverter in network.inverters if inverter.kind == "GFM"}
    assert sorted(len(grid_forming & island) for island in islands) == [0, 1, 1, 1]


def test_islands_are_ordered_by_their_first_bus(network: Network) -> None:
    """Islands come in the order of their first bus in the table, whatever the switches."""
    order = [bus.name for bus in network.feeder.buses]
    islands = network.islands(opened(network, *PAPER_ISLANDS, "60-160"))

    firsts = [min(order.index(bus) for bus in island) for island in islands]
    assert firsts == sorted(firsts)
    assert sum(len(island) for island in islands) == len(order)
