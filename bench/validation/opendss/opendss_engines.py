"""Both OpenDSS engines, each in a process of its own: voltages of scripts in switch states."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

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
    """Solve scripts with an engine.

    Parameters
    ----------
    engine
        One of `ENGINES`.
    jobs
        Each script with the commands that lead from one of its states to the next; `[()]` is the script as it is.

    Raises
    ------
    RuntimeError
        With the engine's last lines, if it failed.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        given, out = folder / "jobs.json", folder / "out.npz"
        given.write_text(json.dumps([(str(path.resolve()), list(map(list, states))) for path, states in jobs]))
        program = Path(__file__).with_name("solve_states.py")
        command = [sys.executable, str(program), engine, str(given), str(out)]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode or not out.exists():
            raise RuntimeError(f"{engine} failed: {(done.stderr or done.stdout)[-1000:]}")
        with np.load(out) as arrays:
            return [SolvedStates(arrays[f"names{i}"].tolist(), arrays[f"V{i}"]) for i in range(len(jobs))]
