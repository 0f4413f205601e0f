"""GridLAB-D in delta mode: the head of a model, and a run of it with every property recorded by its name.

This file is a program, too, as GridLAB-D's state is global: python -m bench.validation.delta_mode REQUEST.json OUT.npz.
REQUEST.json has the path of a model as "model", the number of "steps", what to "read" after every step and what to
"read_between" the two solutions of a step (lists of [object, property, 1 real or 2 complex]), and "writes": lists of
[step, object, property, value] that act at the beginning of that step; a complex value is a list of two numbers.
OUT.npz has a row a step in `rows` and `between`; row 0 is the step at which delta mode starts.
"""

from __future__ import annotations

import ctypes
import importlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridpeers.bridges.gridlabd.delta_mode import CLOCK_UPDATE, DESIRED, STAY, GridlabdCore

START = 946684800
"""GridLAB-D's clock at the start of the model (s since 1970): 2000-01-01. Delta mode begins one second later."""


def delta_header(h: float, seconds: int, bus: str, *powerflow: str) -> str:
    """Write clock, modules and what finds islands.

    The recorder of a bus, into nowhere, keeps the clock going: without anything that wants to be called again GridLAB-D
    stops at once. `h` is the step (s), `seconds` how long delta mode may run, `powerflow` more settings of the module.
    """
    step = round(h * 1e9)
    enabled = f"enable_subsecond_models true;\n\tdeltamode_timestep {step};"
    settings = "".join(f"\n\t{setting};" for setting in powerflow)
    return f"""#set deltamode_forced_always=true
#set deltamode_timestep={step}
#set deltamode_iteration_limit=20
#set minimum_timestep=1
clock {{
	timezone UTC0;
	starttime '2000-01-01 00:00:00';
	stoptime '2000-01-01 00:00:{seconds + 2:02d}';
}}
module tape;
module powerflow {{
	{enabled}
	solver_method NR;
	all_powerflow_delta true;
	line_capacitance false;
	line_limits false;
	NR_island_fail_method true;{settings}
}}
module generators {{
	{enabled}
}}
module reliability {{
	{enabled}
	report_event_log false;
}}
object fault_check {{
	name islands;
	check_mode ONCHANGE;
	strictly_radial false;
	grid_association true;
}}
object recorder {{
	name ticker;
	parent {bus};
	property voltage_A;
	interval 1;
	file "/dev/null";
}}"""


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
    """Run a model (GLM) in delta mode, and record so many steps, the first of delta mode included.

    `read` is recorded after each step and `read_between` between its two solutions; `writes` have the step at whose
    beginning they act, object, property and value. RuntimeError has GridLAB-D's last lines, if it failed.
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
        program = "bench.validation.delta_mode"
        command = [sys.executable, "-m", program, str(folder / "request.json"), str(folder / "out.npz")]
        root = Path(__file__).parents[2]
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


INTERUPDATE = ctypes.CFUNCTYPE(
    ctypes.c_int, ctypes.c_void_p, ctypes.c_int64, ctypes.c_uint64, ctypes.c_ulong, ctypes.c_uint
)

FAILED = 3


class DeltaRecorder:
    """Records properties in the two places of a step where its callbacks are called, for a request as above."""

    def __init__(self, request: dict[str, Any], out: Path) -> None:
        gridlabd = importlib.import_module("gridlabd")
        self._gridlabd = gridlabd.DirectGridLabD()
        if self._gridlabd.load_glm([request["model"]]) != gridlabd.GLDErrorCode.SUCCESS:
            raise RuntimeError("GridLAB-D did not load the model")
        self._core, self._out, self._steps = GridlabdCore(), out, request["steps"]
        self._writes: list[tuple[int, str, str, Any]] = request["writes"]
        module = self._core.module("tape")
        self._gridlabd.setup_after_load()
        self._read, self._read_between = (
            [self._core.doubles(*each) for each in request[key]] for key in ("read", "read_between")
        )
        self._rows: list[list[float]] = []
        self._between: list[list[float]] = []
        start = self._core.clock()
        # the power flow of the start is solved first; delta mode comes a second later
        self._callbacks = (
            DESIRED(lambda flags: STAY if self._core.clock() > start else 1),
            INTERUPDATE(self._interupdate),
            CLOCK_UPDATE(self._step_done),
        )
        self._module_interupdate = ctypes.cast(module.interupdate, INTERUPDATE)
        module.delta_desired, module.interupdate, module.delta_clock_update = (
            ctypes.cast(callback, ctypes.c_void_p).value for callback in self._callbacks
        )

    def run(self) -> None:
        """Run the model; the process ends inside, when the last step is recorded."""
        self._gridlabd.run()
        raise RuntimeError(f"GridLAB-D ended after {len(self._rows)} of {self._steps} steps")

    def _interupdate(self, address: int, t: int, passed: int, h: int, iteration: int) -> int:
        if iteration == 1:
            self._between.append(_values(self._read_between))
        return int(self._module_interupdate(address, t, passed, h, iteration))

    def _step_done(self, address: int, t: float, h: int, mode: int) -> int:
        try:
            self._rows.append(_values(self._read))
            for step, name, key, value in self._writes:
                if step == len(self._rows):
                    if isinstance(value, list):  # real and imaginary part
                        self._core.doubles(name, key, len(value))[:] = value
                    else:
                        self._core.write(name, key, value)
            if len(self._rows) == self._steps:
                np.savez(self._out, rows=np.array(self._rows), between=np.array(self._between))
                os._exit(0)  # GridLAB-D would go on to its own end
        except Exception as error:  # an exception cannot pass through GridLAB-D
            print(f"{type(error).__name__}: {error}", file=sys.stderr, flush=True)
            os._exit(FAILED)
        return mode


def _values(properties: Sequence[Any]) -> list[float]:
    return [number for numbers in properties for number in numbers]


if __name__ == "__main__":
    DeltaRecorder(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")), Path(sys.argv[2])).run()
