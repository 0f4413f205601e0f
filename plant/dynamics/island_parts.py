"""Islands of a large network in parts that the inner loop advances one by one: in the cache, and on all cores.

No island acts on another between two switchings, so a part takes all steps of a control period by itself. Islands
without inverters keep their voltages. The parts depend on the network alone, so bytes do not depend on the cores.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from gridpeers.plant.dynamics.kernel.compiled import Flags, Integers, Real
from gridpeers.plant.dynamics.kernel.controller_pass import ADVANCED, READING, Units
from gridpeers.plant.dynamics.kernel.network_arrays import BlockFactors, Reduced, SparseMaps
from gridpeers.plant.dynamics.kernel.step import run_steps_unlocked
from gridpeers.wire.driver.machine import usable_cores

PART = 1000  # nodes from which on a part is large enough: 0.3 MB of factors, and some 50 inverters
MOST_THREADS = 4  # threads, as far as there are cores: more of them share one path to the memory
Which = Integers | slice  # some of the inverters: a slice where they are neighbours, which needs no copy


@dataclass(frozen=True)
class Part:
    net: Reduced
    branches: Integers  # its live branches
    nodes: int
    size: int
    inverters: Which

    def take(self, units: Units) -> Units:
        own = {name: getattr(units, name)[self.inverters] for name in units._fields[1:]}  # all but f_nom
        return units._replace(**own | {name: own[name].copy() for name in ADVANCED})

    def put(self, own: Units, units: Units) -> None:
        for name in ADVANCED:
            getattr(units, name)[self.inverters] = getattr(own, name)


class IslandParts:
    """The parts of a network at one tangent of its loads; `node_island`: of each node, in the factors' order."""

    def __init__(self, net: Reduced, node_island: Integers, units: Units) -> None:
        self.parts = tuple(_parts(net, node_island, units))
        self._nodes = sum(part.nodes for part in self.parts)

    def __len__(self) -> int:
        return len(self.parts)

    def advance(self, steps: int, h: float, tolerance: float, units: Units, x: Real, out: Real) -> int:
        """Take steps as `run_steps` does; return the iterations, each part's by its share of the nodes.

        Where a part fails, -1 is returned, and all is as before.
        """
        m = x.size // 2

        def step(part: Part) -> tuple[int, Units, Real, Real]:
            own, at = part.take(units), part.branches
            own_x, own_out = np.concatenate([x[at], x[m + at]]), np.zeros((steps, part.size, READING))
            return run_steps_unlocked(0, steps, h, tolerance, part.net, own, own_x, own_out), own, own_x, own_out

        with ThreadPoolExecutor(min(usable_cores(), MOST_THREADS)) as pool:
            done = list(pool.map(step, self.parts))
        if any(status < 0 for status, *_ in done):
            return -1
        for part, (_, own, own_x, own_out) in zip(self.parts, done, strict=True):
            part.put(own, units)
            x[part.branches], x[m + part.branches] = own_x[: part.branches.size], own_x[part.branches.size :]
            out[:, part.inverters] = own_out
        share = (part.nodes * status for part, (status, *_) in zip(self.parts, done, strict=True))
        return -(-sum(share) // self._nodes)


def is_large(net: Reduced) -> bool:
    return bool(net.sparse.constant.size // 2 >= 2 * PART)


def _parts(net: Reduced, node_island: Integers, units: Units) -> Iterator[Part]:
    """Yield parts of `PART` nodes or more; none if one part would have all islands but little ones."""
    size = np.bincount(node_island, minlength=net.leader.size)
    islands = np.unique(net.inverter_island)
    part_of = np.full(net.leader.size, -1, np.int64)
    number, nodes = 0, 0
    left = stepped = int(size[islands].sum())
    worth = stepped > 0 and node_island.size - stepped >= PART
    for island in islands.tolist():
        part_of[island] = number
        nodes, left = nodes + int(size[island]), left - int(size[island])
        if nodes >= PART and left >= PART:  # the last part takes what is left, less than twice as much
            number, nodes = number + 1, 0
    for k in range(number + 1) if number or worth else ():
        yield _part(net, islands[part_of[islands] == k], part_of == k, node_island, units)


def _part(net: Reduced, islands: Integers, of_part: Flags, node_island: Integers, units: Units) -> Part:
    maps, f = net.sparse, net.sparse.factored
    nodes = np.flatnonzero(of_part[node_island])
    branches, inverters = np.flatnonzero(of_part[net.branch_island]), np.flatnonzero(of_part[net.inverter_island])
    node_at, branch_at, inverter_at = (
        _places(which, size)
        for which, size in ((nodes, node_island.size), (branches, net.S.size), (inverters, units.online.size))
    )
    island_at = np.zeros(net.leader.size, np.int64)
    island_at[islands] = np.arange(islands.size)

    count = np.diff(f.start)
    entries = np.flatnonzero(np.repeat(of_part[node_island], count))
    limited = np.flatnonzero(branch_at[net.limited_at] >= 0)
    terminals = maps.terminals[inverters]
    leader = net.leader[islands]
    sparse = SparseMaps(
        factored=BlockFactors(
            np.concatenate([[0], np.cumsum(count[nodes])]),
            node_at[f.later[entries]],
            *(values[at] for values, at in ((f.D, nodes), (f.L, entries), (f.U, entries))),
        ),
        constant=maps.constant.reshape(-1, 2)[nodes].ravel(),
        ends=_moved(node_at, maps.ends[branches]),
        ratios=maps.ratios[branches],
        from_sources=maps.from_sources[branches],
        terminals=_moved(node_at, terminals),
        fixed=maps.fixed[inverters],
        feeds=maps.feeds[inverters],
        scratch=np.empty(4 * nodes.size),
        increments=np.zeros((4, 2 * branches.size)),
        rate=maps.rate.copy(),
    )
    own = net._replace(
        S=net.S[branches],
        I0=net.I0[branches],
        limited_at=branch_at[net.limited_at[limited]],
        law=net.law[limited],
        i_c=net.i_c[branches],
        A=net.A[branches],
        B=net.B[branches],
        branch_island=island_at[net.branch_island[branches]],
        inverter_island=island_at[net.inverter_island[inverters]],
        leader=_moved(inverter_at, leader),
        theta_lin=net.theta_lin[islands],
        sparse=sparse,
    )
    return Part(net=own, branches=branches, nodes=nodes.size, size=inverters.size, inverters=_which(inverters))


def _which(at: Integers) -> Which:
    """Return ascending numbers as a slice if none is missing between them."""
    if at.size and at[-1] - at[0] + 1 > at.size:
        return at
    return slice(int(at[0]), int(at[-1]) + 1) if at.size else slice(0, 0)


def _places(which: Integers, size: int) -> Integers:
    """Return the position of each of `size` things among some of them, or -1."""
    places = np.full(size, -1, np.int64)
    places[which] = np.arange(which.size)
    return places


def _moved(places: Integers, at: Integers) -> Integers:
    return np.where(at >= 0, places[at], at)
