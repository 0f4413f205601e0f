"""Both OpenDSS engines: voltages of scripts in several states.

This file is a program, too, which solves in a process of its own, as EPRI's engine prints, and there is one circuit:
python opendss_engines.py ENGINE JOBS.json OUT.npz. JOBS.json is a list of [script, [[command, ...], ...]]: the commands
of each state are given one after the other to the circuit of that script. OUT.npz has for job 0 its nodes as `names0`,
and the voltages (V) of each state as rows of `V0`: nan where a state did not converge.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

ENGINES = ("dss-python", "py-dss-interface")
"""Distributions of the two engines: that of dss-extensions (Pascal) and EPRI's own (C++)."""


class SolvedStates(NamedTuple):
    """Voltages of a circuit in several states."""

    nodes: list[str]
    """Names as the engine has them: "13.1" is phase A of bus 13."""
    V: NDArray[np.complex128]
    """States x nodes (V); nan where a state did not converge."""

    def state(self, number: int) -> dict[str, complex]:
        """Return the voltages (V) of a state by node."""
        return dict(zip(self.nodes, self.V[number].tolist(), strict=True))


def solve_scripts(engine: str, jobs: Sequence[tuple[Path, Sequence[Sequence[str]]]]) -> list[SolvedStates]:
    """Solve scripts with one of `ENGINES`; RuntimeError has its last lines, if it failed.

    Each job is a script with the commands that lead from one of its states to the next; `[()]` is the script as it is.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        given, out = folder / "jobs.json", folder / "out.npz"
        given.write_text(json.dumps([(str(path.resolve()), list(map(list, states))) for path, states in jobs]))
        program = Path(__file__)
        command = [sys.executable, str(program), engine, str(given), str(out)]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode or not out.exists():
            raise RuntimeError(f"{engine} failed: {(done.stderr or done.stdout)[-1000:]}")
        with np.load(out) as arrays:
            return [SolvedStates(arrays[f"names{i}"].tolist(), arrays[f"V{i}"]) for i in range(len(jobs))]


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
