"""The inverters that `gridpeers init --feeder` proposes."""

from __future__ import annotations

from collections import Counter, defaultdict
from itertools import pairwise

import numpy as np
import pytest
from msgspec.structs import replace

from gridpeers.bridges.proposal.feeder_proposal import GROUP, RATING, NoProposalError, cut_off_sums, propose
from gridpeers.plant.equipment import Bus, Feeder, Source, Switch
from gridpeers.plant.equipment.imported_equipment import LoadPart
from gridpeers.plant.tables import read_feeder
from tests.unit.bridges.proposal.test_feeder_proposal import series


@pytest.mark.parametrize("count", [None, 3, 7, 20, 50])
def test_inverters_are_as_many_as_asked_for_and_each_group_has_one_leader(count: int | None) -> None:
    """Ratings are 1.3 times the load at the heaviest phase, none share a bus, a microgrid is a leader and followers."""
    feeder = read_feeder("standard123")

    found = propose(feeder, count)

    assert count is None or len(found.inverters) == count
    assert len({row.bus for row in found.inverters}) == len(found.inverters)
    assert sum(row.P_rated for row in found.inverters) == pytest.approx(RATING * found.heaviest * found.load, rel=0.05)
    groups = Counter(row.microgrid for row in found.inverters)
    assert set(groups.values()) <= {GROUP - 1, GROUP}
    leaders = Counter(row.microgrid for row in found.inverters if row.kind == "GFM")
    assert leaders == dict.fromkeys(groups, 1)


def two_sections(buses: int) -> Feeder:
    """Beyond one switch a line with so many buses and little load, beyond another a bus with most of it."""
    names = ["s", "s~a", *(f"a{k}" for k in range(buses)), "b", "b1"]
    ties = [("s", "s~a"), (names[-3], "b")]
    lines = [(one, other) for one, other in pairwise(names) if (one, other) not in ties]
    loads = {**dict.fromkeys(names[2:-2], 2e5), "b1": 2e6}
    return Feeder(
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


@pytest.mark.parametrize(("buses", "count", "sizes"), [(9, 6, [1, 3, 2]), (9, 3, [1, 2]), (4, 6, [1, 3])])
def test_a_section_with_one_bus_leaves_its_inverters_to_the_others(buses: int, count: int, sizes: list[int]) -> None:
    """As many inverters are found as asked for, unless there are fewer buses: with 4, one of them a switch's, 4."""
    groups = Counter(row.microgrid for row in propose(two_sections(buses), count).inverters)

    assert sorted(groups.values()) == sorted(sizes)


def test_no_inverter_stands_where_one_phase_is_de_energised() -> None:
    """A bus whose phase B an open switch leaves without voltage gets no inverter; its neighbours do."""
    feeder = two_sections(9)
    first, second = feeder.switches
    open_B = tuple(replace(second, name=f"{second.name}.{phase}", phases=phase, closed=phase != "B") for phase in "ABC")

    buses = {row.bus for row in propose(replace(feeder, switches=(first, *open_B)), 6).inverters}

    assert buses
    assert not buses & {"b", "b1"}


def test_a_load_between_two_phases_is_no_neutral_of_a_proposed_inverter() -> None:
    """One with the voltage of a phase to ground, as people write it by mistake, leaves the inverters on earth."""
    feeder = two_sections(9)
    mistaken = tuple(replace(part, ends=("A", "C")) for part in feeder.load_parts)

    assert {row.neutral for row in propose(replace(feeder, load_parts=mistaken), 6).inverters} == {""}


def test_a_load_too_large_for_three_inverters_a_section_gets_more() -> None:
    """Without a count there are as many as their voltage needs; a count that is too small is refused with the limit."""
    feeder = read_feeder("standard123")
    loads = tuple(replace(load, S=tuple(150.0 * S for S in load.S)) for load in feeder.loads)
    usual, large = propose(feeder), propose(replace(feeder, loads=loads))

    assert len(large.inverters) > len(usual.inverters)
    with pytest.raises(NoProposalError, match=r"need one of \d+ kW at bus .* kW are plausible; give more --inverters"):
        propose(replace(feeder, loads=loads), 6)


def test_inverters_stand_where_the_load_is() -> None:
    """With the load of one half of a feeder gone, they move to the other half."""
    feeder = read_feeder("standard123")
    order = [bus.name for bus in feeder.buses]
    near = {bus for bus in order if bus.isdigit() and int(bus) < 60}

    def share(loads: tuple[object, ...]) -> float:
        rows = propose(replace(feeder, loads=loads), 30).inverters
        return sum(row.bus in near for row in rows) / len(rows)

    everywhere = share(feeder.loads)
    assert share(tuple(load for load in feeder.loads if load.bus not in near)) < everywhere - 0.1
    assert share(tuple(load for load in feeder.loads if load.bus in near)) > everywhere + 0.1


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
