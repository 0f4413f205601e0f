"""The one-line diagram says what its marks are, and its words lie on no branch."""

from __future__ import annotations

from itertools import combinations
from math import cos, radians, sin

import numpy as np
import pytest
from msgspec.structs import replace

from gridpeers.plant.equipment import Tables
from gridpeers.plant.tables import read_feeder
from gridpeers.scenarios.results.plots.feeder_diagram import feeder_diagram
from gridpeers.scenarios.results.plots.places import PlacedLabel, label_sides

Place = tuple[float, float]


def legend(feeder: Tables, V: dict[str, float] | None = None) -> list[str]:
    """The words of a diagram's legend."""
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


@pytest.mark.parametrize("name", ["ieee34", "ieee34 without coordinates"])
def test_no_word_covers_another_and_none_of_the_substation_lies_on_a_branch(name: str) -> None:
    """In the finished picture every name can be read, on a map and on a tree."""
    feeder = read_feeder(name.split()[0])
    if name.endswith("coordinates"):
        feeder = replace(feeder, buses=tuple(replace(bus, x=0.0, y=0.0) for bus in feeder.buses))
    picture = feeder_diagram(feeder)
    picture.draw_without_rendering()
    (axes,) = picture.axes

    boxes = {text.get_text(): text.get_window_extent() for text in axes.texts}
    branches = [path.transformed(axes.transData) for path in axes.collections[0].get_paths()]

    inverters, buses = (*feeder.inverters, *feeder.spares), {bus.name for bus in feeder.buses}
    assert len(set(boxes) - buses) == 1 + len(inverters) + len(feeder.switches)
    assert len(set(boxes) & buses) > 0.9 * (len(buses) - len(inverters) - 1)
    assert [(one, other) for one, other in combinations(boxes, 2) if boxes[one].overlaps(boxes[other])] == []
    assert not any(branch.intersects_bbox(boxes["substation"], filled=False) for branch in branches)


@pytest.mark.parametrize("degrees", [(90,), (0, 90, 180), (80, -80, 180)])
def test_a_word_stands_where_no_branch_leads(degrees: tuple[int, ...]) -> None:
    """However branches lead away from a mark, its word is on none of them."""
    label = PlacedLabel("substation", 10.0, (30.0, 40.0), 9.0)
    lines = np.array([(30.0, 40.0, 30.0 + 200.0 * cos(radians(d)), 40.0 + 200.0 * sin(radians(d))) for d in degrees])

    (side,) = label_sides([label], lines, np.array([[30.0, 40.0, 5.0]]))

    assert side is not None
    right, up = side
    width, height = 62.0, 12.0
    gap = 9.0 if 0 in (right, up) else 6.3
    middle = 30.0 + right * (gap + width / 2.0), 40.0 + up * (gap + height / 2.0)
    for d in degrees:
        along = np.linspace(0.0, 200.0, 2001)[:, None] * (cos(radians(d)), sin(radians(d))) + (30.0, 40.0)
        assert not (np.abs(along - middle) < (width / 2.0, height / 2.0)).all(axis=1).any()


def test_the_name_of_a_bus_that_has_no_room_is_left_out() -> None:
    """Branches on all sides leave no room for what is optional; everything else has its place."""
    star = [(0.0, 0.0, 50.0 * cos(radians(d)), 50.0 * sin(radians(d))) for d in range(0, 360, 15)]
    needed = PlacedLabel("inv1", 10.0, (0.0, 0.0), 8.0)

    assert label_sides([needed, needed._replace(optional=True)], np.array(star), np.empty((0, 3)))[1] is None
    assert label_sides([needed._replace(optional=True)], np.empty((0, 4)), np.empty((0, 3))) == [(1, 1)]
