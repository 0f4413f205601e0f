"""Copies of a feeder, joined at the substation and beyond it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gridpeers.feeder import Feeder
from gridpeers.plant.equipment.connectivity import Connectivity
from gridpeers.plant.equipment.derived_feeders import joined_copies
from gridpeers.plant.network import Network, solve_power_flow


def test_copies_have_the_voltages_of_the_one(tmp_path: Path) -> None:
    """With the ties open each copy is the feeder, but for the charging of the tie that hangs on the later ones."""
    one = Feeder.read("microgrid123")
    three = Feeder.read(joined_copies(one, 3, "450").save(tmp_path / "three"))
    network, joined = Network(one), Network(three)
    V = solve_power_flow(network, network.closed0, tolerance=1e-12).V
    apart = joined.closed0 - {joined.switch_name(name) for name in ("tie_2", "tie_3")}
    W = dict(zip(joined.nodes, solve_power_flow(joined, apart, tolerance=1e-12).V, strict=True))

    for k, rtol in (("", 1e-12), ("_2", 3e-6), ("_3", 3e-6)):
        np.testing.assert_allclose([W[bus + k, phase] for bus, phase in network.nodes], V, rtol=rtol)
    assert len(three.inverters) == 27


def test_copies_that_lose_the_substation_stay_joined() -> None:
    """Opening the switch of every copy leaves one network with all inverters."""
    three = joined_copies(Feeder.read("microgrid123"), 3, "450")
    graph = Connectivity(three)
    opened = {"13-152", "13_2-152_2", "13_3-152_3"}
    parts = graph.parts(graph.closed_at_start() - opened)

    (island,) = {part for part in parts if any(bus == "450" for bus, _ in part)}
    assert {row.bus for row in three.inverters} <= {bus for bus, _ in island}
    assert "150" not in {bus for bus, _ in island}


def test_imported_feeders_can_be_copied(tmp_path: Path) -> None:
    """Elements by their admittance are copied as lines are."""
    pytest.importorskip("dss", reason="the import of .dss files needs the extra opendss")
    one = Feeder.from_opendss(Path(__file__).parents[3] / "feeders" / "ieee13.dss")
    two = Feeder.read(joined_copies(one, 2, "671").save(tmp_path / "two"))

    assert len(two.solve()) == 2 * len(one.solve()) + 3


def test_copies_keep_the_phases_of_their_inverters() -> None:
    """A single-phase inverter stands on the same phase in every copy."""
    one = Feeder.read("microgrid123").add_inverter("roof", "96", "GFL", 5e4, phases="B")
    two = joined_copies(one, 2, "450")

    assert [(row.name, row.bus, row.phases) for row in two.inverters if row.name.startswith("roof")] == [
        ("roof", "96", "B"),
        ("roof_2", "96_2", "B"),
    ]


@pytest.mark.parametrize(
    ("copies", "joint", "text"),
    [
        (0, "450", "from 1 to 111, .*got 0"),
        (112, "450", "at most 1000 inverters"),
        (2, "nope", "needs a bus"),
        (2, "32", "A, B"),
    ],
)
def test_what_cannot_be_joined_is_told(copies: int, joint: str, text: str) -> None:
    """Numbers below one and buses without three phases."""
    with pytest.raises(ValueError, match=text):
        joined_copies(Feeder.read("microgrid123"), copies, joint)
