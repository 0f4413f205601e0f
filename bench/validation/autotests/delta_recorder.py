"""Runs a GridLAB-D model in delta mode and records it, in a process of its own: GridLAB-D's state is global.

Usage: python -m bench.validation.autotests.delta_recorder REQUEST.json OUT.npz

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
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from plant.gridlabd.process.delta_mode import CLOCK_UPDATE, DESIRED, STAY, GridlabdCore

INTERUPDATE = ctypes.CFUNCTYPE(
    ctypes.c_int, ctypes.c_void_p, ctypes.c_int64, ctypes.c_uint64, ctypes.c_ulong, ctypes.c_uint
)

FAILED = 3


class DeltaRecorder:
    """Records properties in the two places of a step where its callbacks are called.

    Parameters
    ----------
    request
        As in the module's text.
    out
        Where the recording goes; it is complete when the process ends with 0.
    """

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
                    self._write(name, key, value)
            if len(self._rows) == self._steps:
                np.savez(self._out, rows=np.array(self._rows), between=np.array(self._between))
                os._exit(0)  # GridLAB-D would go on to its own end
        except Exception as error:  # an exception cannot pass through GridLAB-D
            print(f"{type(error).__name__}: {error}", file=sys.stderr, flush=True)
            os._exit(FAILED)
        return mode

    def _write(self, name: str, key: str, value: Any) -> None:
        if isinstance(value, list):  # real and imaginary part
            self._core.doubles(name, key, len(value))[:] = value
        else:
            self._core.write(name, key, value)


def _values(properties: Sequence[Any]) -> list[float]:
    return [number for numbers in properties for number in numbers]


if __name__ == "__main__":
    DeltaRecorder(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")), Path(sys.argv[2])).run()
