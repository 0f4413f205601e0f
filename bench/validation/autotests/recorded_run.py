"""A recorded run of GridLAB-D: every property's values by its name."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

REAL, COMPLEX = 1, 2

Property = tuple[str, str, int]
"""Object, property, and whether it is `REAL` or `COMPLEX`."""

Values = Mapping[tuple[str, str], NDArray[Any]]
"""One value a step of each property, by object and property."""


class RecordedRun(NamedTuple):
    """Readings of a run."""

    after: Values
    """Values after each step."""
    between: Values
    """Values between the two network solutions of each step."""


def record(
    model: str,
    steps: int,
    read: Sequence[Property],
    read_between: Sequence[Property] = (),
    writes: Sequence[tuple[int, str, str, Any]] = (),
) -> RecordedRun:
    """Run a model in delta mode.

    Parameters
    ----------
    model
        The GLM.
    steps
        How many steps to record, the first of delta mode included.
    read, read_between
        What to record after each step and between its two solutions.
    writes
        Step at whose beginning it acts, object, property, value.

    Raises
    ------
    RuntimeError
        With GridLAB-D's last lines, if it failed.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "model.glm").write_text(model, encoding="utf-8")
        request = {
            "model": str(folder / "model.glm"),
            "steps": steps,
            "read": read,
            "read_between": read_between,
            "writes": writes,
        }
        (folder / "request.json").write_text(json.dumps(request), encoding="utf-8")
        program = "bench.validation.autotests.delta_recorder"
        command = [sys.executable, "-m", program, str(folder / "request.json"), str(folder / "out.npz")]
        root = Path(__file__).parents[3]
        done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(f"GridLAB-D failed: {(done.stderr or done.stdout)[-1000:]}")
        with np.load(folder / "out.npz") as arrays:
            return RecordedRun(_by_name(read, arrays["rows"]), _by_name(read_between, arrays["between"]))


def _by_name(properties: Sequence[Property], rows: NDArray[np.float64]) -> Values:
    values, at = {}, 0
    for name, key, numbers in properties:
        column = rows[:, at : at + numbers]
        values[name, key] = column[:, 0] + 1j * column[:, 1] if numbers == COMPLEX else column[:, 0]
        at += numbers
    return values
