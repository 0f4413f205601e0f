"""All combinations of a feeder's switches, each island with one stiff source."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from bench.validation.opendss.write_opendss import IDEAL_SOURCE
from plant.equipment import PHASES, Feeder, Source
from plant.network import Network, solve_power_flow


class SwitchStates:
    """Combinations of open and closed switches of a feeder, and their islands.

    An island without the substation gets a stiff source of 1 pu at its first bus with three phases. Where a closed
    switch of fewer phases is the only way to a section of three, the other phases of that section have no source: such
    a state has no operating point, and is left out.

    Parameters
    ----------
    feeder
        The feeder; it has a substation.
    """

    def __init__(self, feeder: Feeder) -> None:
        self._feeder = feeder
        self._network = Network(feeder)
        self._bridges = {each.name: each for each in feeder.switches if len(each.phases) < len(PHASES)}
        self._three_phase = [bus.name for bus in feeder.buses if set(bus.phases) >= set(PHASES)]
        self._solved: dict[tuple[str, frozenset[str]], NDArray[np.complex128]] = {}
        self._islands: dict[frozenset[str], dict[str, frozenset[str]]] = {}

    def combinations(self) -> list[frozenset[str]]:
        """Return the closed switches of every combination."""
        names = [each.name for each in self._feeder.switches]
        return [
            frozenset(name for name, closed in zip(names, state, strict=True) if closed)
            for state in product((False, True), repeat=len(names))
        ]

    def has_operating_point(self, closed: frozenset[str]) -> bool:
        """Return whether every phase of every island has a source."""
        without = self._network.islands(closed - set(self._bridges))
        return all(
            any({bridge.from_bus, bridge.to_bus} <= island for island in without)
            for name, bridge in self._bridges.items()
            if name in closed
        )

    def sources(self, closed: frozenset[str]) -> dict[str, frozenset[str]]:
        """Return the bus of each island's source, and the island's buses."""
        if closed not in self._islands:
            substation = self._feeder.source
            assert substation is not None
            islands = self._network.islands(closed)
            self._islands[closed] = {
                substation.bus
                if substation.bus in island
                else next(bus for bus in self._three_phase if bus in island): island
                for island in islands
            }
        return self._islands[closed]

    def voltages(self, closed: frozenset[str]) -> NDArray[np.complex128]:
        """Return our voltages (V) at all nodes; an island that is the same in two states is solved once."""
        V = np.zeros(len(self._network.nodes), np.complex128)
        for bus, island in self.sources(closed).items():
            own = frozenset(
                each.name for each in self._feeder.switches if each.name in closed and each.from_bus in island
            )
            if (bus, own) not in self._solved:
                self._solved[bus, own] = self._solve(bus, own)
            V += self._solved[bus, own]
        return V

    def islands_solved(self) -> int:
        """Return how many different islands there were."""
        return len(self._solved)

    def commands(self, states: list[frozenset[str]]) -> Iterator[list[str]]:
        """Return the commands for OpenDSS that lead from one state to the next; sources are made in the first."""
        anchors = sorted({bus for closed in states for bus in self.sources(closed)} - {self._substation.bus})
        kV = {bus.name: bus.V_nom * 3**0.5 / 1e3 for bus in self._feeder.buses}
        new = [
            f"New Vsource.at{bus} bus1={bus} basekv={kV[bus]!r} pu=1 angle=0 {IDEAL_SOURCE} enabled=no"
            for bus in anchors
        ]
        for closed in states:
            switching = [
                f"{'Close' if each.name in closed else 'Open'} Line.{each.name} 1" for each in self._feeder.switches
            ]
            fed = self.sources(closed)
            enabling = [f"Edit Vsource.at{bus} enabled={'yes' if bus in fed else 'no'}" for bus in anchors]
            yield [*new, *switching, *enabling]
            new = []

    @property
    def _substation(self) -> Source:
        assert self._feeder.source is not None
        return self._feeder.source

    def _solve(self, bus: str, closed: frozenset[str]) -> NDArray[np.complex128]:
        if bus == self._substation.bus:
            network = self._network
        else:
            network = Network(replace(self._feeder, source=Source(bus=bus, V_pu=1.0, angle=0.0)))
        return solve_power_flow(network, closed, tolerance=1e-12).V
