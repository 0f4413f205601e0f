"""GridLAB-D in a process of its own, stepped from outside through its delta mode.

GridLAB-D's Python interface runs all delta steps of a second in one call, and its state is global. So this file is a
program for itself, run by whichever interpreter has the wheel `gridlabd`; it needs nothing else. It overwrites two
function pointers of a loaded module (`tape`) with callbacks: one keeps the core in delta mode, the other is called
after every step and, when enough are done, holds GridLAB-D until the next request comes.

Requests are JSON objects, one a line on standard input, answered one a line on standard output:

    {"load": path, "inverters": [[name, bus, kind, phases], ...]}    {}; the first step is done
    {"write": [[object, property, value], ...]}             {}; acts from the next step on
    {"phasors": bus}                                        {"phasors": [real, imaginary] (V) of its phases A, B, C}
    {"write": ..., "advance": n}                            {"steps": n lists of a reading per inverter}

A reading is f (Hz), P (W), Q (var), mean line-to-neutral V (V), the set-points as GridLAB-D holds them: `Pset` (pu)
of a GFM or `Pref` (W) of a GFL, and `Vset` (pu); then the lowest and the highest phase voltage (V). What goes wrong is
answered as {"error": text}, a package gridlabd that cannot be imported as {"not_importable": text}.
The process ends with standard input.
"""

from __future__ import annotations

import ctypes
import importlib
import json
import os
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

STAY = 0  # answer of a module that wants delta mode now; any other answer is the time (s) until it does
SWITCH_STATES = {"open": 0, "close": 1}  # values of a switch's property `status`

Reading = tuple[float, float, float, float, float, float, float, float]


class Module(ctypes.Structure):
    """Head of GridLAB-D's record of a loaded module, as of version 6.0.0."""

    _fields_ = (
        ("library", ctypes.c_void_p),
        ("id", ctypes.c_uint),
        ("name", ctypes.c_char * 1024),
        ("first_class", ctypes.c_void_p),
        ("major", ctypes.c_ushort),
        ("minor", ctypes.c_ushort),
        *((name, ctypes.c_void_p) for name in ("getvar", "setvar", "import_file", "export_file", "check")),
        *((name, ctypes.c_void_p) for name in ("delta_desired", "preupdate", "interupdate", "delta_clock_update")),
    )


CLOCK_UPDATE = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_double, ctypes.c_ulong, ctypes.c_int)
DESIRED = ctypes.CFUNCTYPE(ctypes.c_ulong, ctypes.c_void_p)


class GridlabdCore:
    """GridLAB-D's shared library: its clock, modules and objects' properties by raw pointer."""

    def __init__(self) -> None:
        with Path("/proc/self/maps").open(encoding="utf-8") as maps:
            path = next(line.split()[-1] for line in maps if "libgldapi" in line)
        self._library = ctypes.CDLL(path)
        for name, result, arguments in (
            ("module_find", ctypes.POINTER(Module), (ctypes.c_char_p,)),
            ("object_find_name", ctypes.c_void_p, (ctypes.c_char_p,)),
            ("object_get_addr", ctypes.c_void_p, (ctypes.c_void_p, ctypes.c_char_p)),
        ):
            function = getattr(self._library, name)
            function.restype, function.argtypes = result, arguments

    def clock(self) -> int:
        return ctypes.c_int64.in_dll(self._library, "global_clock").value

    def module(self, name: str) -> Any:
        """Give a loaded module; RuntimeError if this GridLAB-D lays it out in another way."""
        module = self._library.module_find(name.encode())
        if not module or module.contents.name != name.encode():
            raise RuntimeError(f'module "{name}" is not laid out as in GridLAB-D 6.0.0; install gridlabd==6.0.0')
        return module.contents

    def doubles(self, name: str, key: str, count: int = 1) -> Any:
        """View an object's property: a real (1) or a complex number (2)."""
        return (ctypes.c_double * count).from_address(self._address(name, key))

    def write(self, name: str, key: str, value: Any) -> None:
        """Write a real property, or a switch's status ("open" or "close")."""
        if key == "status":
            ctypes.c_uint32.from_address(self._address(name, key)).value = SWITCH_STATES[value]
        else:
            self.doubles(name, key)[0] = value

    def _address(self, name: str, key: str) -> int:
        handle = self._library.object_find_name(name.encode())
        address = self._library.object_get_addr(handle, key.encode()) if handle else None
        if not address:
            raise KeyError(f"{name}.{key}")
        return int(address)


class GridlabdInverter:
    """Quantities of an inverter, read after every step."""

    def __init__(self, core: GridlabdCore, name: str, bus: str, kind: str, phases: str) -> None:
        forming = kind == "GFM"
        # a single-phase inverter has the first PLL, whichever its phase
        plls = [f"f_PLL_{phase}" for phase in "ABC"[: len(phases)]]
        self._f = [core.doubles(name, key) for key in (["freq"] if forming else plls)]
        self._S = core.doubles(name, "VA_Out", 2)
        self._V = [core.doubles(bus, f"voltage_{phase}", 2) for phase in phases]
        self._P_set, self._V_set = core.doubles(name, "Pset" if forming else "Pref"), core.doubles(name, "Vset")

    def read(self) -> Reading:
        V = [abs(complex(*phase)) for phase in self._V]
        set_points = self._P_set[0], self._V_set[0]
        f = sum(each[0] for each in self._f) / len(self._f)
        return f, self._S[0], self._S[1], sum(V) / len(V), *set_points, min(V), max(V)


class NotImportableError(Exception):
    """The package gridlabd is missing, or damaged."""


def gridlabd_package() -> ModuleType:
    try:
        package = importlib.import_module("gridlabd")
        _ = package.DirectGridLabD, package.GLDErrorCode
        return package
    except Exception as error:  # a damaged package may raise anything
        raise NotImportableError(f"{type(error).__name__}: {error}") from error


class Simulation:
    """A model whose delta steps are taken when they are asked for; GridLAB-D itself runs in a thread.

    `inverters` has the name, bus, kind and phases of each.
    """

    def __init__(self, model: str, inverters: list[tuple[str, str, str, str]]) -> None:
        gridlabd = gridlabd_package()
        self._gridlabd = gridlabd.DirectGridLabD()
        if self._gridlabd.load_glm([model]) != gridlabd.GLDErrorCode.SUCCESS:
            raise RuntimeError("it refuses the model")
        self.core = GridlabdCore()
        self._hook(self.core.module("tape"))
        self._gridlabd.setup_after_load()
        self._inverters = [GridlabdInverter(self.core, *inverter) for inverter in inverters]
        self._go, self._done = threading.Semaphore(0), threading.Semaphore(0)
        self._left = 1
        self._error: Exception | None = None
        self._steps: list[list[Reading]] = []
        threading.Thread(target=self._run, daemon=True).start()
        self._wait()

    def advance(self, steps: int) -> list[list[Reading]]:
        self._left, self._steps = steps, []
        self._go.release()
        self._wait()
        return self._steps

    def _wait(self) -> None:
        self._done.acquire()
        if self._error is not None:
            raise self._error

    def _run(self) -> None:
        self._gridlabd.run()
        self._error = self._error or RuntimeError("it ended its simulation before its time")
        self._done.release()

    def _hook(self, module: Any) -> None:
        start = self.core.clock()

        def clock_update(address: int, t: float, h: int, mode: int) -> int:
            try:
                self._steps.append([inverter.read() for inverter in self._inverters])
            except Exception as error:  # an exception cannot pass through GridLAB-D
                self._error = error
                return 255  # ends the run
            self._left -= 1
            if self._left == 0:
                self._done.release()
                self._go.acquire()
            return mode

        # the power flow of the start is solved first; delta mode comes a second later
        desired = DESIRED(lambda flags: STAY if self.core.clock() > start else 1)
        self._callbacks = desired, CLOCK_UPDATE(clock_update)  # kept: the module has only pointers to them
        module.delta_desired, module.delta_clock_update = (
            ctypes.cast(callback, ctypes.c_void_p).value for callback in self._callbacks
        )


def answers(requests: Iterator[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    first = next(requests)
    simulation = Simulation(first["load"], first["inverters"])
    yield {}
    for request in requests:
        if "phasors" in request:
            phases = (simulation.core.doubles(request["phasors"], f"voltage_{phase}", 2) for phase in "ABC")
            yield {"phasors": [list(phase) for phase in phases]}
            continue
        for name, key, value in request.get("write", ()):
            simulation.core.write(name, key, value)
        yield {"steps": simulation.advance(request["advance"])} if "advance" in request else {}


def main() -> None:
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # GridLAB-D prints to standard output
    try:
        for answer in answers(json.loads(line) for line in sys.stdin):
            print(json.dumps(answer), file=out, flush=True)
    except NotImportableError as error:
        print(json.dumps({"not_importable": str(error)}), file=out, flush=True)
    except Exception as error:
        text = str(error) if isinstance(error, RuntimeError) else f"{type(error).__name__}: {error}"
        print(json.dumps({"error": text}), file=out, flush=True)
    os._exit(0)  # GridLAB-D's thread still waits inside a step


if __name__ == "__main__":
    main()
