"""Part "power-flow": the power flow beside both OpenDSS engines, also in every switch state of the microgrid feeder."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from itertools import product
from pathlib import Path

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from bench.validation.opendss_engines import ENGINES, solve_scripts
from bench.validation.validation_part import CaseResult, ToleranceCheck, ValidationPart
from bench.validation.write_opendss import IDEAL_SOURCE, write_opendss
from gridpeers.bridges.opendss import read_opendss
from gridpeers.plant.equipment import PHASES, Source, Tables
from gridpeers.plant.network import Network, solve_power_flow
from gridpeers.plant.tables import read_feeder


class SwitchStates:
    """Combinations of open and closed switches of a feeder that has a substation, and their islands.

    An island without the substation gets a stiff source of 1 pu at its first bus with three phases. Where a closed
    switch of fewer phases is the only way to a section of three, the other phases of that section have no source: such
    a state has no operating point, and is left out.
    """

    def __init__(self, feeder: Tables) -> None:
        self._feeder = feeder
        assert feeder.source is not None
        self._substation = feeder.source.bus
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
            self._islands[closed] = {
                self._substation
                if self._substation in island
                else next(b for b in self._three_phase if b in island): island
                for island in self._network.islands(closed)
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
        anchors = sorted({bus for closed in states for bus in self.sources(closed)} - {self._substation})
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

    def _solve(self, bus: str, closed: frozenset[str]) -> NDArray[np.complex128]:
        if bus == self._substation:
            network = self._network
        else:
            network = Network(replace(self._feeder, source=Source(bus=bus, V_pu=1.0, angle=0.0)))
        return solve_power_flow(network, closed)


LIMIT = 1e-6
"""Largest difference of a phasor (pu of nominal voltage); what the engines' switches and regulators drop is below."""

SCRIPTS = Path(__file__).parents[2] / "tests" / "feeders"

SWITCH_STATES = "switch-states"

CASES = {
    "ieee13": "IEEE 13-node feeder, imported from its script",
    "ieee34": "IEEE 34-node feeder, imported from its script",
    "standard123": "IEEE 123-node feeder, our tables",
    "microgrid123": "our microgrid feeder, load set main",
    "microgrid123-event2": "our microgrid feeder, load set event2",
    SWITCH_STATES: "our microgrid feeder in every switch state",
}


def _run(case: str) -> CaseResult:
    with tempfile.TemporaryDirectory() as folder:
        if case.startswith("ieee"):
            script = SCRIPTS / f"{case}.dss"
            return _feeder(case, read_opendss(script), script)
        name, _, load_set = ("microgrid123" if case == SWITCH_STATES else case).partition("-")
        feeder, script = read_feeder(name, load_set or "main"), Path(folder) / "feeder.dss"
        script.write_text(write_opendss(feeder), encoding="utf-8")
        return _switch_states(feeder, script) if case == SWITCH_STATES else _feeder(case, feeder, script)


def _feeder(case: str, feeder: Tables, script: Path) -> CaseResult:
    ours, nominal = _our_voltages(feeder)
    differences = {engine: _differences(ours, nominal, engine, script) for engine in ENGINES}
    return _result(case, differences, {"nodes": str(len(differences[ENGINES[0]])), "states": "1"})


def _switch_states(feeder: Tables, script: Path) -> CaseResult:
    """Compare every node in every switch state that has an operating point."""
    states, network = SwitchStates(feeder), Network(feeder)
    every = states.combinations()
    fed = [closed for closed in every if states.has_operating_point(closed)]
    ours = np.array([states.voltages(closed) for closed in fed])
    names, commands = _node_names(network), list(states.commands(fed))
    differences = {}
    for engine in ENGINES:
        theirs = solve_scripts(engine, [(script, commands)])[0]
        order = [theirs.nodes.index(name) for name in names]
        differences[engine] = (np.abs(ours - theirs.V[:, order]) / network.V_nom).ravel()
    told = f"{len(fed)} of {len(every)}, with {states.islands_solved()} different islands"
    return _result(SWITCH_STATES, differences, {"nodes": str(len(names)), "states": told})


def _result(case: str, differences: Mapping[str, NDArray[np.float64]], facts: Mapping[str, str]) -> CaseResult:
    checks = (ToleranceCheck(f"V, pu, {engine}", float(gap.max()), LIMIT) for engine, gap in differences.items())
    return CaseResult(case, tuple(checks), facts)


def _node_names(network: Network) -> list[str]:
    """Return the nodes as OpenDSS names them."""
    return [f"{bus}.{'ABC456789'.index(phase) + 1}" for bus, phase in network.nodes]


def _our_voltages(feeder: Tables) -> tuple[dict[str, complex], dict[str, float]]:
    """Return voltage and nominal voltage (V) of each node, named as OpenDSS names them."""
    network = Network(feeder)
    V = solve_power_flow(network, network.closed0)
    names = _node_names(network)
    return dict(zip(names, V.tolist(), strict=True)), dict(zip(names, network.V_nom.tolist(), strict=True))


def _differences(
    ours: Mapping[str, complex], nominal: Mapping[str, float], engine: str, script: Path
) -> NDArray[np.float64]:
    """Return the difference (pu) at every node of the engine; nan where we lack it. Ours has more: at switches."""
    theirs = solve_scripts(engine, [(script, [()])])[0].state(0)
    return np.array([abs(ours.get(name, complex("nan")) - V) / nominal.get(name, 1.0) for name, V in theirs.items()])


POWER_FLOW = ValidationPart("power-flow", ENGINES, CASES, _run)
