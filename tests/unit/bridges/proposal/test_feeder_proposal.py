"""Where a feeder of one's own is islanded and drawn, also if it has no switch, no coordinates or no load."""

from __future__ import annotations

from collections import Counter, defaultdict
from itertools import pairwise

import numpy as np
import pytest
from msgspec.structs import replace

from gridpeers.bridges.proposal.feeder_proposal import (
    GROUP,
    RATING,
    NoProposalError,
    NoSwitchError,
    cut_off_sums,
    propose,
)
from gridpeers.plant.equipment import Bus, Source, Switch, Tables
from gridpeers.plant.equipment.imported_equipment import LinearElement, LoadPart
from gridpeers.plant.tables import read_feeder
from gridpeers.scenarios.results.plots.feeder_diagram import feeder_diagram
from gridpeers.scenarios.results.plots.places import places


def series(name: str, start: str, end: str, phases: str) -> LinearElement:
    """A line of one siemens a phase."""
    nodes = tuple((bus, phase) for bus in (start, end) for phase in phases)
    n = len(phases)
    rows = tuple(tuple(complex((i == j) - (abs(i - j) == n)) for j in range(2 * n)) for i in range(2 * n))
    return LinearElement(name=name, nodes=nodes, Y=rows)


def feeder(phases: str = "ABC", P: float = 5e5, *, switched: bool = False, places: bool = False) -> Tables:
    """A substation, a line (behind a switch if there is one) and a second line to a load."""
    names = ("s", "s~l", "a", "b") if switched else ("s", "a", "b")
    buses = tuple(
        Bus(name=name, phases="ABC" if name == "s" else phases, V_nom=2400.0, x=places * (k + 1.0), y=places * 1.0)
        for k, name in enumerate(names)
    )
    switch = Switch(name="s-s~l", alias="l", from_bus="s", to_bus="s~l", phases=phases, closed=True)
    part = LoadPart(name="load.l", bus="b", ends=(phases[0], ""), S=complex(P), V_nom=2400.0, exponents=(2.0, 2.0))
    return Tables(
        name="small",
        load_set="main",
        buses=buses,
        switches=(switch,) if switched else (),
        source=Source(bus="s", V_pu=1.0, angle=0.0),
        elements=(series("line.l", names[-3], "a", phases), series("line.m", "a", "b", phases)),
        load_parts=(part,) if P else (),
    )


def test_a_switch_that_cuts_off_the_load_is_proposed() -> None:
    proposal = propose(feeder(switched=True))

    assert proposal.switch == "l"
    assert proposal.load == 5e5
    assert sum(row.P_rated for row in proposal.inverters) > 5e5


def test_without_a_switch_lines_to_be_one_are_named() -> None:
    """A feeder without a switch names the lines near the substation that would make one."""
    with pytest.raises(NoSwitchError, match=r"make a line a switch, e\.g\. --switch Line\.l") as refused:
        propose(feeder())

    assert refused.value.lines[0] == "Line.l"


@pytest.mark.parametrize(("small", "told"), [
    (feeder("A"), "no single three-phase line does either"),
    (feeder("A", switched=True), "no bus has phases A, B and C, which an inverter needs"),
    (feeder(P=0.0, switched=True), "the feeder has no load"),
])  # fmt: skip
def test_what_cannot_be_islanded_says_why(small: Tables, told: str) -> None:
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
    assert places(feeder(places=True)) == {"s": (1.0, 1.0), "a": (2.0, 1.0), "b": (3.0, 1.0)}


def test_inverters_carry_the_load_and_each_group_has_one_leader() -> None:
    """Ratings are 1.3 times the load at the heaviest phase, none share a bus, a microgrid is a leader and followers."""
    found = propose(read_feeder("standard123"))

    assert len({row.bus for row in found.inverters}) == len(found.inverters)
    assert sum(row.P_rated for row in found.inverters) == pytest.approx(RATING * found.heaviest * found.load, rel=0.05)
    groups = Counter(row.microgrid for row in found.inverters)
    assert set(groups.values()) == {GROUP}
    leaders = Counter(row.microgrid for row in found.inverters if row.kind == "GFM")
    assert leaders == dict.fromkeys(groups, 1)


def two_sections(buses: int) -> Tables:
    """Beyond one switch a line with so many buses and little load, beyond another a bus with most of it."""
    names = ["s", "s~a", *(f"a{k}" for k in range(buses)), "b", "b1"]
    ties = [("s", "s~a"), (names[-3], "b")]
    lines = [(one, other) for one, other in pairwise(names) if (one, other) not in ties]
    loads = {**dict.fromkeys(names[2:-2], 2e5), "b1": 2e6}
    return Tables(
        name="two",
        load_set="main",
        buses=tuple(Bus(name=name, phases="ABC", V_nom=2400.0, x=0.0, y=0.0) for name in names),
        switches=tuple(
            Switch(name=f"{one}-{other}", alias=other, from_bus=one, to_bus=other, phases="ABC", closed=True)
            for one, other in ties
        ),
        source=Source(bus="s", V_pu=1.0, angle=0.0),
        elements=tuple(series(f"line.{other}", one, other, "ABC") for one, other in lines),
        load_parts=tuple(
            LoadPart(name=f"load.{bus}", bus=bus, ends=("A", ""), S=complex(P), V_nom=2400.0, exponents=(2.0, 2.0))
            for bus, P in loads.items()
        ),
    )


def test_a_section_with_few_buses_has_fewer_inverters() -> None:
    """A section has a group for each 2 MW of load as far as it has buses; one with a single bus has a leader alone."""
    groups = Counter(row.microgrid for row in propose(two_sections(9)).inverters)

    assert sorted(groups.values()) == [1, GROUP]


def test_no_inverter_stands_where_one_phase_is_de_energised() -> None:
    """A bus whose phase B an open switch leaves without voltage gets no inverter; its neighbours do."""
    feeder = two_sections(9)
    first, second = feeder.switches
    open_B = tuple(replace(second, name=f"{second.name}.{phase}", phases=phase, closed=phase != "B") for phase in "ABC")

    buses = {row.bus for row in propose(replace(feeder, switches=(first, *open_B))).inverters}

    assert buses
    assert not buses & {"b", "b1"}


def test_a_load_between_two_phases_is_no_neutral_of_a_proposed_inverter() -> None:
    """One with the voltage of a phase to ground, as people write it by mistake, leaves the inverters on earth."""
    feeder = two_sections(9)
    mistaken = tuple(replace(part, ends=("A", "C")) for part in feeder.load_parts)

    assert {row.neutral for row in propose(replace(feeder, load_parts=mistaken)).inverters} == {""}


def test_a_load_too_large_for_a_group_gets_more_and_one_too_large_for_all_is_refused() -> None:
    """There are as many groups as a section's load and its voltage need, as far as it has buses."""
    feeder = read_feeder("standard123")

    def times(k: float) -> Tables:
        return replace(feeder, loads=tuple(replace(load, S=tuple(k * S for S in load.S)) for load in feeder.loads))

    assert len(propose(times(10.0)).inverters) > len(propose(feeder).inverters)
    with pytest.raises(NoProposalError, match=r"needs an inverter of \d+ kW at bus .* kW are plausible; try another"):
        propose(times(1e4))


@pytest.mark.parametrize("seed", range(8))
def test_what_a_branch_cuts_off_is_what_is_not_reached_without_it(seed: int) -> None:
    """One walk gives for every branch of a random network what removing it gives; a branch in a loop cuts nothing."""
    rng = np.random.default_rng(seed)
    names = [f"b{k}" for k in range(12)]
    branches = [(names[int(rng.integers(k))], names[k]) for k in range(1, 12)]
    branches += [tuple(rng.choice(names, 2, replace=False).tolist()) for _ in range(seed % 4)]
    load = {name: float(rng.integers(1, 100)) for name in names}

    def neighbours(left_out: int | None = None) -> dict[str, list[str]]:
        near: defaultdict[str, list[str]] = defaultdict(list)
        for k, (one, other) in enumerate(branches):
            if k != left_out:
                near[one].append(other)
                near[other].append(one)
        return near

    sums = cut_off_sums(neighbours(), "b0", load)

    for k, (one, other) in enumerate(branches):
        near, reached, waiting = neighbours(k), {"b0"}, ["b0"]
        while waiting:
            waiting += (new := [bus for bus in dict.fromkeys(near[waiting.pop()]) if bus not in reached])
            reached.update(new)
        lost = sum(load[bus] for bus in names if bus not in reached)
        assert max(sums.get((one, other), 0.0), sums.get((other, one), 0.0)) == pytest.approx(lost)
