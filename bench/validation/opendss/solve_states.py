"""Solves switch states of circuits with an OpenDSS engine, in a process of its own: EPRI's prints, and there is one.

Usage: python solve_states.py ENGINE JOBS.json OUT.npz

ENGINE is "dss-python" (dss-extensions, in Pascal) or "py-dss-interface" (EPRI, in C++). JOBS.json is a list of
[script, [[command, ...], ...]]: the commands of each state are given one after the other to the circuit of that script.
OUT.npz has for job 0 its nodes as `names0`, and the voltages (V) of each state as rows of `V0`: nan where a state did
not converge.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

SETTLE = "set maxcontroliter=1000", "set maxiterations=1000", "solve", "set controlmode=off"
"""Controls settle first, then stay."""

COARSE, FINE = "set tolerance=1e-6", "set tolerance=1e-11"
"""Convergence is judged by the coarse one: close to rounding, a sound solution may never call itself converged."""


class Engine(NamedTuple):
    """Request to an engine."""

    command: Callable[[str], Any]
    converged: Callable[[], bool]
    names: Callable[[], list[str]]
    voltages: Callable[[], Any]
    """Real and imaginary parts in turn (V), in the order of the names."""


def engine(name: str) -> Engine:
    """Return an engine by its distribution."""
    if name == "dss-python":
        from dss import DSS

        DSS.AllowForms = DSS.AllowEditor = DSS.AllowChangeDir = False
        circuit = DSS.ActiveCircuit
        return Engine(
            lambda text: setattr(DSS.Text, "Command", text),
            lambda: bool(circuit.Solution.Converged),
            lambda: list(circuit.YNodeOrder),
            lambda: circuit.YNodeVarray,
        )
    import py_dss_interface

    epri = py_dss_interface.DSS()
    return Engine(
        epri.text,
        lambda: bool(epri.solution.converged),
        lambda: list(epri.circuit.y_node_order),
        lambda: epri.circuit.y_node_varray,
    )


def main(name: str, jobs: Path, out: Path) -> None:
    """Solve every state of every job."""
    circuit = engine(name)
    arrays: dict[str, Any] = {}
    for number, (script, states) in enumerate(json.loads(jobs.read_text(encoding="utf-8"))):
        for command in (f'compile "{script}"', *SETTLE):
            circuit.command(command)
        rows, order = [], None
        for commands in states:
            for command in (*commands, COARSE, "solve"):
                circuit.command(command)
            sound = circuit.converged()
            for command in (FINE, "solve"):
                circuit.command(command)
            names = [each.lower() for each in circuit.names()]
            order = order or names
            found = dict(zip(names, np.asarray(circuit.voltages(), float).reshape(-1, 2) @ (1.0, 1j), strict=True))
            rows.append([found[each] if sound else complex("nan") for each in order])
        arrays |= {f"names{number}": np.array(order), f"V{number}": np.array(rows)}
    np.savez(out, **arrays)


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3]))
