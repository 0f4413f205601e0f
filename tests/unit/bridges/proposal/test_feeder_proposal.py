"""Where a feeder of one's own is islanded and drawn, also if it has no switch, no coordinates or no load."""

from __future__ import annotations

import pytest

from gridpeers.bridges.proposal.feeder_proposal import NoProposalError, NoSwitchError, propose
from gridpeers.plant.equipment import Bus, Feeder, Source, Switch
from gridpeers.plant.equipment.imported_equipment import LinearElement, LoadPart
from gridpeers.scenarios.results.plots.feeder_diagram import feeder_diagram
from gridpeers.scenarios.results.plots.places import places


def series(name: str, start: str, end: str, phases: str) -> LinearElement:
    """A line of one siemens a phase."""
    nodes = tuple((bus, phase) for bus in (start, end) for phase in phases)
    n = len(phases)
    rows = tuple(tuple(complex((i == j) - (abs(i - j) == n)) for j in range(2 * n)) for i in range(2 * n))
    return LinearElement(name=name, nodes=nodes, Y=rows)


def feeder(phases: str = "ABC", P: float = 5e5, *, switched: bool = False, places: bool = False) -> Feeder:
    """A substation, a line (behind a switch if there is one) and a second line to a load."""
    names = ("s", "s~l", "a", "b") if switched else ("s", "a", "b")
    buses = tuple(
        Bus(name=name, phases="ABC" if name == "s" else phases, V_nom=2400.0, x=places * (k + 1.0), y=places * 1.0)
        for k, name in enumerate(names)
    )
    switch = Switch(name="s-s~l", alias="l", from_bus="s", to_bus="s~l", phases=phases, closed=True)
    part = LoadPart(name="load.l", bus="b", ends=(phases[0], ""), S=complex(P), V_nom=2400.0, exponents=(2.0, 2.0))
    return Feeder(
        name="small",
        load_set="main",
        buses=buses,
        lines=(),
        line_configs=(),
        switches=(switch,) if switched else (),
        loads=(),
        capacitors=(),
        regulators=(),
        transformers=(),
        inverters=(),
        source=Source(bus="s", V_pu=1.0, angle=0.0),
        elements=(series("line.l", names[-3], "a", phases), series("line.m", "a", "b", phases)),
        load_parts=(part,) if P else (),
    )


def test_a_switch_that_cuts_off_the_load_is_proposed() -> None:
    """The switch is the one that cuts off the load, and the inverters carry it with the margin."""
    proposal = propose(feeder(switched=True))

    assert proposal.switch == "l"
    assert proposal.load == 5e5
    assert sum(row.P_rated for row in proposal.inverters) > 5e5


def test_without_a_switch_lines_to_be_one_are_named() -> None:
    """A feeder without a switch names the lines near the substation that would make one."""
    with pytest.raises(NoSwitchError, match=r"name a line to be one, such as Line\.l") as refused:
        propose(feeder())

    assert refused.value.lines[0] == "Line.l"


@pytest.mark.parametrize(
    ("small", "told"),
    [
        (feeder("A"), "no single three-phase line does either"),
        (feeder("A", switched=True), "no bus has phases A, B and C, which an inverter needs"),
        (feeder(P=0.0, switched=True), "the feeder has no load"),
    ],
)
def test_what_cannot_be_islanded_says_why(small: Feeder, told: str) -> None:
    """A feeder of one phase, and one without load, are refused in one line."""
    with pytest.raises(NoProposalError, match=told):
        propose(small)


def test_a_feeder_without_coordinates_is_drawn_as_a_tree() -> None:
    """Buses without coordinates stand apart, farther from the substation the farther they are on the feeder."""
    at = places(feeder(switched=True))

    assert len(set(at.values())) == 4
    assert at["s"][0] < at["s~l"][0] < at["a"][0] < at["b"][0]
    assert feeder_diagram(feeder(switched=True), {"s": 1.0, "s~l": 1.0, "a": 0.99, "b": 0.98}).axes


def test_a_feeder_with_coordinates_is_drawn_on_them() -> None:
    """Coordinates are kept."""
    assert places(feeder(places=True)) == {"s": (1.0, 1.0), "a": (2.0, 1.0), "b": (3.0, 1.0)}
