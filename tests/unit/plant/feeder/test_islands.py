import numpy as np

from gridpeers.plant.dynamics.reduction import DenseReduction
from gridpeers.plant.feeder.circuits import Circuits
from gridpeers.plant.feeder.islands import Islands
from gridpeers.plant.network import Network
from tests.unit.plant.networks import PAPER_ISLANDS, opened


def reduced(network: Network, closed: frozenset[str], *, off: tuple[str, ...] = ()) -> DenseReduction:
    """The reduction of a switch state, with some inverters disconnected."""
    units = network.inverters
    return DenseReduction(
        Circuits(network).of(closed),
        np.full(len(units), 0.1 - 1.0j),
        np.array([unit.kind == "GFM" for unit in units]),
        np.array([unit.name not in off for unit in units]),
    )


def test_islands_are_named_by_their_first_inverter(network: Network) -> None:
    """The island that the substation feeds is "grid"; any other has the name of its first inverter."""
    islands = Islands(network)

    whole, fed = islands.names(reduced(network, network.closed0))
    parts, alone = islands.names(reduced(network, opened(network, *PAPER_ISLANDS)))

    assert (set(whole), all(fed)) == ({"grid"}, True)
    assert parts == ["inv1"] * 3 + ["inv4"] * 3 + ["inv7"] * 3
    assert not any(alone)


def test_who_delivers_is_told(network: Network) -> None:
    """A report names the inverters that deliver in each island, and leaves out those that are disconnected."""
    closed = opened(network, *PAPER_ISLANDS)
    told = Islands(network).report(1.0, closed, reduced(network, closed, off=("inv5",)))

    assert [(event.t, event.kind, event.subject, event.text) for event in told] == [
        (1.0, "island", "inv1", "island of inv1, inv2, inv3"),
        (1.0, "island", "inv4", "island of inv4, inv6"),
        (1.0, "island", "inv7", "island of inv7, inv8, inv9"),
    ]


def test_an_island_that_stays_as_it_is_is_told_once(network: Network) -> None:
    """A switch that only drops load changes no island; one that parts another leaves the third untold."""
    whole, parts = opened(network, "13-152"), opened(network, "13-152", "sw1_2")
    islands = Islands(network)

    first, again, then = (islands.report(1.0, closed, reduced(network, closed)) for closed in (whole, whole, parts))

    assert [event.subject for event in first] == ["inv1"]
    assert again == []
    assert [event.subject for event in then] == ["inv1", "inv4"]


def test_an_island_without_gfm_is_dead_and_told_once(network: Network) -> None:
    """Buses that lose their last GFM are told with load and idle inverters, once until they have been fed again."""
    closed = opened(network, *PAPER_ISLANDS)
    dead, alive = reduced(network, closed, off=("inv4",)), reduced(network, closed)
    islands = Islands(network)

    first, again, fed, last = (islands.report_dead(1.0, closed, state) for state in (dead, dead, alive, dead))

    (event,) = first
    assert (event.kind, again, fed) == ("dead", [], [])
    assert event.text.startswith("de-energised: ")
    assert "without substation or GFM, 985 kW of load not served, inv4, inv5, inv6 idle" in event.text
    assert last == first
