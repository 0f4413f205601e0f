"""Voltages of a feeder written for OpenDSS: those of the engine, and those of our power flow after the import."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from gridpeers.bridges.opendss import read_opendss
from gridpeers.plant.network import Network, solve_power_flow

LETTERS = "ABC456789"
TOLERANCE = 1e-6  # largest difference that the tests allow (pu of nominal voltage)
SOURCE = """Clear
Set DefaultBaseFrequency=60
New Circuit.test bus1=s basekv=12.47 pu=1.02 angle=10 r1=0.1 x1=0.5 r0=0.2 x0=0.9
"""
"""Begins a script: a substation that is not stiff."""

LINE = """New LineCode.uneven nphases=3 units=mi rmatrix=(0.35 | 0.16 0.34 | 0.15 0.15 0.36)
~ xmatrix=(1.02 | 0.50 1.05 | 0.42 0.38 1.03) cmatrix=(17 | -5 16 | -3 -2 15)
New Line.head bus1=s bus2=b linecode=uneven length=2 units=mi
"""
"""A line from there to bus b."""

STEP_DOWN = """New Transformer.down phases=3 windings=2 xhl=4 %loadloss=1
~ buses=(b c) conns=(wye wye) kvs=(12.47 0.48) kvas=(500 500)
"""
"""A transformer from there to bus c."""


def write(folder: Path, *parts: str) -> Path:
    """Write a script that begins with a source and ends by solving it."""
    path = folder / "Master.dss"
    path.write_text(SOURCE + "\n".join(parts) + "\nSet VoltageBases=(12.47 4.16 0.48 0.208)\nCalcVoltageBases\nSolve\n")
    return path


def engine_voltages(path: Path) -> dict[str, complex]:
    """Voltage (V) of each node, "bus.1", as the engine of dss-python has it after settling its controls."""
    from dss import DSS

    engine: Any = DSS.NewContext()
    engine.AllowForms = engine.AllowEditor = engine.AllowChangeDir = False
    settle = "set maxcontroliter=1000", "set maxiterations=1000", "solve"
    for command in (f'compile "{path}"', *settle, "set controlmode=off", "set tolerance=1e-11", "solve"):
        engine.Text.Command = command
    circuit = engine.ActiveCircuit
    pairs = np.asarray(circuit.YNodeVarray, float).reshape(-1, 2)
    return {str(name).lower(): complex(*pair) for name, pair in zip(circuit.YNodeOrder, pairs, strict=True)}


def our_voltages(path: Path) -> tuple[dict[str, complex], dict[str, float]]:
    """Voltage and nominal voltage (V) of each node after the import, named as the engine names them."""
    network = Network(read_opendss(path))
    solved = solve_power_flow(network, network.closed0)
    names = [f"{bus}.{LETTERS.index(phase) + 1}" for bus, phase in network.nodes]
    return dict(zip(names, solved.tolist(), strict=True)), dict(zip(names, network.V_nom.tolist(), strict=True))


def largest_difference(path: Path, engine: dict[str, complex] | None = None) -> float:
    """Largest difference between engine and import (pu) over every node that the engine has."""
    theirs = engine_voltages(path) if engine is None else engine
    ours, nominal = our_voltages(path)
    assert len(theirs) >= 3
    return max(abs(ours[name] - V) / nominal[name] for name, V in theirs.items())
