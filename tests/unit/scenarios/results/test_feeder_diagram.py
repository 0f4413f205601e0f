"""The one-line diagram says what its marks are, and no name covers another."""

from __future__ import annotations

from itertools import combinations

import pytest
from msgspec.structs import replace

from gridpeers.plant.equipment import Tables
from gridpeers.plant.tables import read_feeder
from gridpeers.scenarios.results.plots.feeder_diagram import feeder_diagram


def legend(feeder: Tables, V: dict[str, float] | None = None) -> list[str]:
    return [text.get_text() for text in feeder_diagram(feeder, V).legends[0].get_texts()]


def test_colours_and_marks_are_in_the_legend() -> None:
    """Microgrids are told by their colours, inverters by that of theirs, switches by what black and white mean."""
    said = legend(read_feeder("microgrid123"))

    assert [text.partition(":")[0] for text in said[:3]] == ["MG1", "MG2", "MG3"]
    assert all(" kW of load, " in text and " kW of inverters" in text for text in said[:3])
    assert "GFM inverter, in its microgrid's colour" in said
    assert {"closed switch: black", "open switch: white"} <= set(said)


def test_a_feeder_without_coordinates_says_that_it_is_a_tree() -> None:
    """Its picture is no map, and nobody should read lengths off it."""
    feeder = read_feeder("ieee34")
    bare = replace(feeder, buses=tuple(replace(bus, x=0.0, y=0.0) for bus in feeder.buses))

    drawn, tree = (feeder_diagram(each).get_suptitle() for each in (feeder, bare))

    assert drawn == ""
    assert "no coordinates: drawn as a tree" in tree


def test_a_legend_of_many_microgrids_leaves_room_for_the_feeder() -> None:
    """Beyond ten zones the legend counts the rest, and says that colours repeat."""
    feeder = read_feeder("microgrid123")
    zones = {load.bus: f"zone {k % 20:02}" for k, load in enumerate(feeder.loads)}
    buses = tuple(replace(bus, zone=zones.get(bus.name, "zone 00")) for bus in feeder.buses)
    said = legend(replace(feeder, buses=buses, inverters=(), spares=()))

    assert sum(" kW of load" in text for text in said) == 10
    assert "and 10 more zones; the colours repeat" in said


@pytest.mark.parametrize("name", ["ieee34", "microgrid123"])
def test_no_name_covers_another(name: str) -> None:
    """In the finished picture the names of the substation, of all inverters and of all switches can be read."""
    feeder = read_feeder(name)
    picture = feeder_diagram(feeder)
    picture.draw_without_rendering()

    boxes = {text.get_text(): text.get_window_extent() for text in picture.axes[0].texts}

    assert len(boxes) == 1 + len(feeder.inverters) + len(feeder.spares) + len(feeder.switches)
    assert [(one, other) for one, other in combinations(boxes, 2) if boxes[one].overlaps(boxes[other])] == []
