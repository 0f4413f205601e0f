"""The inverters that `gridpeers init --feeder` proposes."""

from __future__ import annotations

from collections import Counter, defaultdict

import numpy as np
import pytest
from msgspec.structs import replace

from plant.tables import read_feeder
from scenarios.feeder_proposal import GROUP, RATING, propose
from scenarios.feeder_walk import cut_off_sums


@pytest.mark.parametrize("count", [None, 3, 7, 20, 50])
def test_inverters_are_as_many_as_asked_for_and_each_group_has_one_leader(count: int | None) -> None:
    """Their ratings are 1.3 times the load, no two share a bus, and a microgrid has one leader and two followers."""
    feeder = read_feeder("standard123")

    found = propose(feeder, count)

    assert count is None or len(found.inverters) == count
    assert len({row.bus for row in found.inverters}) == len(found.inverters)
    assert sum(row.P_rated for row in found.inverters) == pytest.approx(RATING * found.load, rel=0.05)
    groups = Counter(row.microgrid for row in found.inverters)
    assert set(groups.values()) <= {GROUP - 1, GROUP}
    leaders = Counter(row.microgrid for row in found.inverters if row.kind == "GFM")
    assert leaders == dict.fromkeys(groups, 1)


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
