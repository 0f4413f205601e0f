"""The one-line diagram says what its marks are, and its words lie on no branch."""

from __future__ import annotations

from itertools import combinations
from math import cos, radians, sin

import numpy as np
import pytest
from msgspec.structs import replace

from gridpeers.plant.equipment import Feeder
from gridpeers.plant.equipment.derived_feeders import joined_copies
from gridpeers.plant.tables import read_feeder
from gridpeers.scenarios.results.plots.feeder_diagram import feeder_diagram
from gridpeers.scenarios.results.plots.places import Label, label_sides, places

Place = tuple[float, float]


def legend(feeder: Feeder, V: dict[str, float] | None = None) -> list[str]:
    """The words of a diagram's legend."""
    return [text.get_text() for text in feeder_diagram(feeder, V).legends[0].get_texts()]


def test_colours_and_marks_are_in_the_legend() -> None:
    """Microgrids are told by their colours, inverters by that of theirs, switches by what black and white mean."""
    said = legend(read_feeder("microgrid123"))

    assert [text.partition(":")[0] for text in said[:3]] == ["MG1", "MG2", "MG3"]
    assert all(" kW of load, " in text and " kW of inverters" in text for text in said[:3])
    assert "GFM inverter, in its microgrid's colour" in said
    assert {"closed switch: black", "open switch: white"} <= set(said)


def test_with_colours_of_voltage_the_inverters_have_none() -> None:
    """One colour has one meaning: of the voltage, and the legend then names no microgrid."""
    feeder = read_feeder("ieee34")
    picture = feeder_diagram(feeder, {bus.name: 1.0 for bus in feeder.buses})

    marks = [line for line in picture.axes[0].lines if line.get_marker() in ("s", "o") and line.get_markersize() >= 8]
    assert {line.get_markerfacecolor() for line in marks} == {"#8a8a8a"}
    assert legend(feeder, {bus.name: 1.0 for bus in feeder.buses})[0] == "GFM inverter"


def test_every_microgrid_of_a_section_is_in_the_legend() -> None:
    """A section may have several microgrids, but one colour for its branches: the other colours are explained, too."""
    feeder = read_feeder("ieee34")
    (first, *others) = feeder.inverters
    shared = replace(feeder, inverters=(replace(first, microgrid="MG4"), *others))

    assert any(text == f"MG4: {first.P_rated / 1e3:.0f} kW of inverters" for text in legend(shared))


def test_a_feeder_without_coordinates_says_that_it_is_a_tree() -> None:
    """Its picture is no map, and nobody should read lengths off it."""
    feeder = read_feeder("ieee34")
    bare = replace(feeder, buses=tuple(replace(bus, x=0.0, y=0.0) for bus in feeder.buses))

    drawn, tree = (feeder_diagram(each).get_suptitle() for each in (feeder, bare))

    assert drawn == ""
    assert "no coordinates: drawn as a tree" in tree


def test_no_branch_of_a_tree_crosses_another() -> None:
    """Branches stand side by side in the order of the feeder: lines that cross would look connected."""
    feeder = read_feeder("ieee34")
    at = places(replace(feeder, buses=tuple(replace(bus, x=0.0, y=0.0) for bus in feeder.buses)))
    ends = [(a, b) for a, b, _ in feeder.branches()] + [(one.from_bus, one.to_bus) for one in feeder.switches]
    lines = [(*sorted((at[a], at[b])),) for a, b in ends]

    def crosses(one: tuple[Place, Place], other: tuple[Place, Place]) -> bool:
        """Whether two branches of the same column change their order on the way."""
        (x, y), (_, y2) = one
        (x_other, y_other), (_, y2_other) = other
        return x == x_other and (y - y_other) * (y2 - y2_other) < 0.0

    assert not [pair for pair in combinations(lines, 2) if crosses(*pair)]


def test_a_legend_of_many_microgrids_leaves_room_for_the_feeder() -> None:
    """Beyond ten zones the legend counts the rest, and says that colours repeat."""
    said = legend(joined_copies(read_feeder("microgrid123"), 4, "450"))

    assert sum(" kW of load" in text for text in said) == 10
    assert "and 10 more zones; the colours repeat" in said


@pytest.mark.parametrize("name", ["microgrid123", "ieee34", "ieee34 without coordinates"])
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


@pytest.mark.parametrize("degrees", [(0,), (90,), (-90, 0), (180, -90), (0, 90, 180), (45, 135, -90), (80, -80, 180)])
def test_a_word_stands_where_no_branch_leads(degrees: tuple[int, ...]) -> None:
    """However branches lead away from a mark, its word is on none of them."""
    label = Label("substation", 10.0, (30.0, 40.0), 9.0)
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


def test_a_second_word_gives_way_to_the_first() -> None:
    """Two marks at one place have their words on two sides."""
    label = Label("inv1", 10.0, (0.0, 0.0), 8.0)
    first, second = label_sides([label, label], np.empty((0, 4)), np.empty((0, 3)))

    assert first != second


def test_the_name_of_a_bus_that_has_no_room_is_left_out() -> None:
    """Branches on all sides leave no room for what is optional; everything else has its place."""
    star = [(0.0, 0.0, 50.0 * cos(radians(d)), 50.0 * sin(radians(d))) for d in range(0, 360, 15)]
    needed = Label("inv1", 10.0, (0.0, 0.0), 8.0)

    assert label_sides([needed, needed._replace(optional=True)], np.array(star), np.empty((0, 3)))[1] is None
    assert label_sides([needed._replace(optional=True)], np.empty((0, 4)), np.empty((0, 3))) == [(1, 1)]
