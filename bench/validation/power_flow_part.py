"""Part (a): the power flow beside both OpenDSS engines."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.validation.opendss.opendss_engines import ENGINES, solve_scripts
from bench.validation.opendss.switch_states import SwitchStates
from bench.validation.opendss.write_opendss import write_opendss
from bench.validation.validation_part import CaseResult, ToleranceCheck, ValidationPart
from plant.equipment import Feeder
from plant.imports.opendss import read_opendss
from plant.network import Network, solve_power_flow
from plant.tables import read_feeder

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


def _feeder(case: str, feeder: Feeder, script: Path) -> CaseResult:
    ours, nominal = _our_voltages(feeder)
    differences = {engine: _differences(ours, nominal, engine, script) for engine in ENGINES}
    return _result(case, differences, {"nodes": str(len(differences[ENGINES[0]])), "states": "1"})


def _switch_states(feeder: Feeder, script: Path) -> CaseResult:
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


def _our_voltages(feeder: Feeder) -> tuple[dict[str, complex], dict[str, float]]:
    """Return voltage and nominal voltage (V) of each node, named as OpenDSS names them."""
    network = Network(feeder)
    V = solve_power_flow(network, network.closed0, tolerance=1e-12).V
    names = _node_names(network)
    return dict(zip(names, V.tolist(), strict=True)), dict(zip(names, network.V_nom.tolist(), strict=True))


def _differences(
    ours: Mapping[str, complex], nominal: Mapping[str, float], engine: str, script: Path
) -> NDArray[np.float64]:
    """Return the difference (pu) at every node of the engine; nan where we lack it. Ours has more: at switches."""
    theirs = solve_scripts(engine, [(script, [()])])[0].state(0)
    return np.array([abs(ours.get(name, complex("nan")) - V) / nominal.get(name, 1.0) for name, V in theirs.items()])


POWER_FLOW = ValidationPart("power-flow", ENGINES, CASES, _run)
