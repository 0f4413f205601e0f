"""GridLAB-D's own power flow of a model: a program for a process of its own, as GridLAB-D's state is global.

It loads the model and solves the power flow by Newton's method at the model's first moment. Where regulators or
capacitors have a control, GridLAB-D goes on until they rest. The result is what the solver holds: buses, branches with
their admittance matrices as the solver uses them, and the powers, currents and admittances that every node, meter, load
and capacitor takes itself. GridLAB-D publishes no admittances, so they are read from its tables of the solver,
`NR_busdata` and `NR_branchdata`, whose layout is that of version 6.0.0.
"""

from __future__ import annotations

import ctypes
import math
import os
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from gridpeers.bridges.engine_process import Tell, serve
from gridpeers.bridges.gridlabd.delta_mode import GridlabdCore, NotImportableError, gridlabd_package
from gridpeers.bridges.gridlabd.glm_text import CHILD_OF_BUS, WATCHING
from gridpeers.plant.tables.read import FeederError
from gridpeers.wire.wording import damaged, printable

STRIDE = 3  # doubles of a complex number in GridLAB-D's arrays: real part, imaginary part, notation

_pointer, _double, _byte = ctypes.c_void_p, ctypes.c_double, ctypes.c_ubyte


class SolverBus(ctypes.Structure):
    """Head of a row of `NR_busdata`."""

    _fields_ = (
        ("type", ctypes.c_int),
        ("phases", _byte),
        ("original_phases", _byte),
        ("flags", _pointer),
        *((name, _pointer) for name in ("V", "S", "Y", "I", "prerotated_I", "S_dy", "Y_dy", "I_dy")),
        *((name, _pointer) for name in ("full_Y", "full_Y_all", "full_Y_load", "extra", "house", "links")),
        ("link_count", ctypes.c_uint),
        ("PL", _double * 3),
        ("QL", _double * 3),
        ("has_dynamics", _pointer),
        ("is_swing", ctypes.c_bool),
        ("is_entry", ctypes.c_bool),
        *((name, _pointer) for name in ("generation", "dynamic_I", "history", "saturation")),
        ("V_nom", _double),
        ("mva_base", _double),
        ("jacobian", _double * 12),
        ("fixed_point_I", _double * (3 * STRIDE)),
        ("place", ctypes.c_uint),
        ("tolerance", _double),
        ("name", ctypes.c_char_p),
        ("object", _pointer),
        *((name, _pointer) for name in ("injection", "injector", "load_update", "shunt_update")),
        ("island", ctypes.c_int),
    )


class SolverBranch(ctypes.Structure):
    """A row of `NR_branchdata`."""

    _fields_ = (
        *((name, _pointer) for name in ("Y_from", "Y_to", "YS_from", "YS_to")),
        ("phases", _byte),
        ("original_phases", _byte),
        ("fault_phases", _byte),
        ("from_", ctypes.c_int),
        ("to", ctypes.c_int),
        ("fault_below", ctypes.c_int),
        ("status", _pointer),
        ("kind", _byte),
        ("ratio", _double),
        ("name", ctypes.c_char_p),
        ("object", _pointer),
        *((name, _pointer) for name in ("fault_I_from", "fault_I_to", "limit_check", "delta_mode")),
        ("island", ctypes.c_int),
    )


class ObjectHead(ctypes.Structure):
    """Head of every object of GridLAB-D."""

    _fields_ = (
        ("id", ctypes.c_uint),
        ("kind", _pointer),
        ("name", ctypes.c_char_p),
        ("group", ctypes.c_char * 40),
        ("next", _pointer),
        ("parent", _pointer),
        ("children", ctypes.c_uint),
        ("rank", ctypes.c_uint),
        ("times", ctypes.c_int64 * 3),
        ("forecast", _pointer),
        ("latitude", _double),
        ("longitude", _double),
    )


class ModelCore(GridlabdCore):
    """GridLAB-D's shared library: objects' heads, flags and properties by raw pointer."""

    def find(self, name: bytes) -> int | None:
        address: int | None = self._library.object_find_name(name)
        return address

    def stop_after(self, seconds: int) -> None:
        start, stop = (ctypes.c_int64.in_dll(self._library, f"global_{which}time") for which in ("start", "stop"))
        stop.value = start.value + seconds

    def head(self, name: str) -> Any:
        """Return an object's head; RuntimeError if this GridLAB-D lays it out in another way."""
        head = ObjectHead.from_address(self.find(name.encode()) or 0)
        if head.name != name.encode():
            raise RuntimeError("objects are not laid out as in GridLAB-D 6.0.0; install gridlabd==6.0.0")
        return head

    def has(self, name: str, key: str) -> bool:
        return bool(self._library.object_get_addr(self.find(name.encode()), key.encode()))

    def object_of(self, name: str, key: str) -> str:
        """Return the name of an object that a property refers to, or an empty text."""
        address = _pointer.from_address(self._address(name, key)).value
        return ObjectHead.from_address(address).name.decode() if address else ""

    def bits(self, name: str, key: str) -> int:
        """Return a property that is a set of flags, or one of a list."""
        return ctypes.c_uint32.from_address(self._address(name, key)).value

    def complex(self, name: str, key: str) -> complex:
        return complex(*self.doubles(name, key, 2))


def complexes(address: int | None, count: int) -> np.ndarray[Any, np.dtype[np.complex128]]:
    """Return an array of GridLAB-D's complex numbers; no address is zeros."""
    if not address:
        return np.zeros(count, complex)
    values = np.array((_double * (STRIDE * count)).from_address(address)).reshape(count, STRIDE)
    return values[:, 0] + 1j * values[:, 1]


TOLERANCE = "1e-10"
"""Largest change of a voltage in the last iteration (pu). GridLAB-D's default, 1e-6, costs six digits."""

WRITTEN = ("file", "filename", "output_file", "outfile", "report_file", "base_file_name", "output_filename")
"""Properties that name a file which GridLAB-D would write into the folder of the model."""

PHASE_D = 0x100  # bit of an object's `phases`: delta-connected
PV, SWING = 1, 2
"""Values of `bustype`, and of the solver's `type`, of buses whose voltage is given, in magnitude or entirely."""

WYE, AROUND, LEGS = ("A", "B", "C"), ("AB", "BC", "CA"), ("1", "2", "12")
"""Branches of a load: to ground, between phases, of a split-phase service."""

POSITIONS = {"regulator": "tap_", "capacitor": "switch"}
"""Classes that a control moves, and the names of their positions, one a phase."""

DELAYS = ("time_delay", "dwell_time", "lockout_time", "regulator_delay", "capacitor_delay")
"""Properties (s) that let a control wait."""

LONGEST_SETTLING = 3600  # time (s) that GridLAB-D goes on at most
KINDS = {"P": "power", "I": "current", "Y": "shunt"}
"""Kinds of a load's demand (VA, A, S), and the word in the names of GridLAB-D's properties."""


class PowerFlowModel:
    """A model of GridLAB-D, loaded; what it writes goes into the folder `scratch`."""

    def __init__(self, module: ModuleType, path: Path, scratch: Path) -> None:
        self._scratch, self._module = scratch, module
        self._gridlabd = self._module.DirectGridLabD()
        if self._gridlabd.load_glm([str(path)]) != self._module.GLDErrorCode.SUCCESS:
            raise RuntimeError("the model was not loaded")
        self._core = ModelCore()
        self._classes = {
            name: kind
            for kind in self._gridlabd.get_all_classes()
            for name in self._gridlabd.get_objects_by_class(kind)
        }

    def solve(self) -> dict[str, Any]:
        """Return what the solver holds at the model's first moment, or when its regulators and capacitors rest.

        It has `buses`, `branches` and what each object `takes` if there is a solution, `settling` if a control may move
        something.
        """
        frequency = self._gridlabd.get_global("powerflow::nominal_frequency")
        result: dict[str, Any] = {"objects": self._objects(), "has_powerflow": frequency != ""}
        if not result["has_powerflow"]:
            return result
        result["method"] = self._gridlabd.get_global("powerflow::solver_method")
        result["f_nom"] = float(frequency.split()[0])
        for name, value in (
            ("powerflow::solver_method", "NR"),
            ("powerflow::NR_solver_algorithm", "TCIM"),
            ("powerflow::default_maximum_voltage_error", TOLERANCE),
            ("stoptime", self._gridlabd.get_global("starttime")),
            ("powerflow::NR_matrix_output_interval", "NEVER"),
            ("savefile", ""),
            ("checkpoint_type", "NONE"),
            ("checkpoint_file", os.devnull),
            ("dumpfile", str(self._scratch / "gridlabd.xml")),
            ("dumpall", "0"),
            ("kmlfile", ""),
        ):
            self._gridlabd.set_global(name, value)
        self._keep_quiet()
        if result["method"] != "NR":
            self._give_a_swing()
        if moved := self._controlled():
            self._core.stop_after(LONGEST_SETTLING)
        self._gridlabd.setup_after_load()
        if moved:
            result |= self._settle(moved)
        elif self._gridlabd.run() == self._module.GLDErrorCode.SUCCESS:
            result |= self._solver_tables()
        return result

    def _objects(self) -> dict[str, tuple[str, str, tuple[float, float]]]:
        """Return class, parent and coordinates of each object."""
        found = {}
        for name, kind in self._classes.items():
            head = self._core.head(name)
            parent = ObjectHead.from_address(head.parent).name.decode() if head.parent else ""
            known = math.isfinite(head.longitude) and math.isfinite(head.latitude)
            found[name] = kind, parent, (head.longitude, head.latitude) if known else (0.0, 0.0)
        return found

    def _keep_quiet(self) -> None:
        """Let nothing be written beside the model, nothing be asserted, no node be content with a coarser tolerance."""
        for name, kind in self._classes.items():
            for key in self._gridlabd.get_object_properties(name):
                if key in WRITTEN and kind != "player":
                    self._gridlabd.set_property(name, key, os.devnull)
                elif key == "interval" and kind in WATCHING:  # each of their moments would be a step
                    self._gridlabd.set_property(name, key, str(LONGEST_SETTLING))
            if kind.endswith("assert"):
                self._gridlabd.set_property(name, "status", "ASSERT_NONE")
            if kind in CHILD_OF_BUS and self._core.has(name, "maximum_voltage_error"):
                self._core.doubles(name, "maximum_voltage_error")[0] = 0.0

    def _give_a_swing(self) -> None:
        """Make the only bus to which no branch leads the substation, as it is one in a forward-backward sweep."""
        buses = [name for name in self._classes if self._core.has(name, "bustype")]
        if any(self._core.bits(name, "bustype") == SWING for name in buses):
            return
        branches = [name for name in self._classes if self._core.has(name, "from") and self._core.has(name, "to")]
        first, last = ({self._core.object_of(name, key) for name in branches} for key in ("from", "to"))
        if len(roots := first - last) == 1:
            self._gridlabd.set_property(roots.pop(), "bustype", "SWING")

    def _controlled(self) -> list[str]:
        """Return the regulators and capacitors that a control of their own, or one of the model, may move."""
        found = [name for name, kind in self._classes.items() if kind in POSITIONS]
        if "volt_var_control" in self._classes.values():
            return found

        def control_of(name: str) -> str:
            if self._classes[name] == "capacitor":
                return str(self._gridlabd.get_object_properties(name)["control"])
            configuration = self._core.object_of(name, "configuration")
            return str(self._gridlabd.get_object_properties(configuration)["Control"]) if configuration else ""

        return [name for name in found if control_of(name) not in ("MANUAL", "")]

    def _settle(self, moved: list[str]) -> dict[str, Any]:
        """Go on until the positions have been the same for longer than any control waits, or for an hour.

        Return what the solver holds then, or at the first moment if it finds no solution later. `settling` has whether
        it was `solved` all the time and whether the positions `rest`, the `time` as GridLAB-D writes it, and the
        `seconds` since the first moment.
        """
        wait = 2.0 * max(
            (self._core.doubles(name, key)[0] for name in self._classes for key in DELAYS if self._core.has(name, key)),
            default=0.0,
        )
        start = changed = later = self._core.clock()
        last = self._positions(moved)
        tables: dict[str, Any] = {}
        solved = True
        while solved and later - changed <= wait and later <= start + LONGEST_SETTLING:
            now, time = later, self._gridlabd.get_global("clock")
            solved = self._gridlabd.step()[0] == self._module.GLDErrorCode.SUCCESS
            before, last = last, self._positions(moved)
            later = max(self._core.clock(), now)
            if now == start:
                if solved and later > start:
                    tables = self._solver_tables()
            elif last != before:
                changed = now
        rest = min(later, start + LONGEST_SETTLING) - changed > wait
        if solved:
            tables = self._solver_tables()
        settling = {"solved": solved, "rest": rest, "time": time, "seconds": now - start}
        return {**tables, "settling": settling}

    def _positions(self, names: list[str]) -> dict[str, list[str]]:
        found = {}
        for name in names:
            own = self._gridlabd.get_object_properties(name)
            found[name] = [str(own[f"{POSITIONS[self._classes[name]]}{phase}"]) for phase in WYE]
        return found

    def _solver_tables(self) -> dict[str, Any]:
        """Return `buses`, `branches`, whose ends are places of buses, and what each object `takes`."""
        powerflow = ctypes.CDLL(str(Path(str(self._module.__file__)).parent / "lib" / "powerflow.so"))

        def table(name: str, row: type[ctypes.Structure]) -> Any:
            count = ctypes.c_uint.in_dll(powerflow, f"NR_{name}_count").value
            address = ctypes.c_void_p.in_dll(powerflow, f"NR_{name}data").value
            return (row * count).from_address(address) if address else ()

        buses, branches = [], []
        for bus in table("bus", SolverBus):
            if self._core.find(bus.name) != bus.object:
                raise RuntimeError("buses are not laid out as in GridLAB-D 6.0.0; install gridlabd==6.0.0")
            buses.append(
                {
                    "name": bus.name.decode(),
                    "class": self._classes[bus.name.decode()],
                    "type": bus.type,
                    "phases": bus.original_phases | bus.phases,
                    "V_nom": bus.V_nom,
                    "V": complexes(bus.V, 3),
                }
            )
        for branch in table("branch", SolverBranch):
            name = branch.name.decode()
            row = {
                "name": name,
                "class": self._classes[name],
                "from": branch.from_,
                "to": branch.to,
                "phases": branch.original_phases | branch.phases,
                "open": bool(branch.status) and ctypes.c_uint.from_address(branch.status).value == 0,
            }
            for key in ("Y_from", "Y_to", "YS_from", "YS_to"):
                row[key] = complexes(getattr(branch, key), 9).reshape(3, 3)
            if self._core.has(name, "switch_impedance"):
                row["Z"] = self._core.complex(name, "switch_impedance")
            elif self._core.has(name, "fuse_resistance"):  # the solver has the admittance (1 + j) / R
                row["Z"] = self._core.doubles(name, "fuse_resistance")[0] / (1.0 + 1.0j)
            branches.append(row)
        takes = {name: self._takes(name) for name, kind in self._classes.items() if kind in CHILD_OF_BUS}
        return {"buses": buses, "branches": branches, "takes": takes}

    def _takes(self, name: str) -> dict[tuple[str, str], complex]:
        """Return the powers, currents and admittances of one object itself, by kind and branch."""
        core, kind = self._core, self._classes[name]
        delta = bool(core.bits(name, "phases") & PHASE_D)
        if kind == "capacitor" and core.bits(name, "phases_connected") & PHASE_D and not delta:
            # at a bus of the other connection, for which GridLAB-D makes up admittances to ground
            V, connected = core.doubles(name, "cap_nominal_voltage")[0], core.bits(name, "phases_connected")
            return {
                ("Y", ends): 1j * core.doubles(name, f"capacitor_{phase}")[0] / V**2
                for k, (ends, phase) in enumerate(zip(AROUND, WYE, strict=True))
                if connected & (1, 2, 4)[k] and core.bits(name, f"switch{phase}")
            }
        found: dict[tuple[str, str], complex] = {}
        for letter, word in KINDS.items():
            if kind.startswith("triplex"):
                properties = [(leg, f"{word}_{leg}") for leg in LEGS]
            else:
                own = AROUND if delta else WYE
                properties = [(ends, f"{word}_{phase}") for ends, phase in zip(own, WYE, strict=True)]
                if letter != "Y":  # GridLAB-D's names shunt_AB etc. lead to its powers
                    properties += [(ends, f"{word}_{ends}") for ends in AROUND]
                    properties += [(phase, f"{word}_{phase}N") for phase in WYE]
            values = [(branch, core.complex(name, key)) for branch, key in properties]
            if letter == "Y" and kind == "load":
                Z = [(ends, core.complex(name, f"constant_impedance_{ends}")) for ends in AROUND]
                Z += [(phase, core.complex(name, f"constant_impedance_{phase}N")) for phase in WYE]
                values += [(branch, 1.0 / value) for branch, value in Z if value]
            for branch, value in values:
                if value:
                    found[letter, branch] = found.get((letter, branch), 0j) + value
        return found


def main() -> None:
    serve("GridLAB-D", read_model)


def read_model(request: dict[str, Any], _tell: Tell) -> dict[str, Any]:
    """Return what GridLAB-D's solver holds of a model (`PowerFlowModel.solve`)."""
    path, scratch = Path(request["path"]), Path.cwd()
    try:
        module = gridlabd_package()
    except NotImportableError as error:
        problem = damaged("gridlabd", printable(str(error)), "the import of .glm files")
        raise FeederError(path.name, (problem,)) from None
    os.chdir(path.parent)  # where GridLAB-D seeks what the model includes
    return PowerFlowModel(module, path, scratch).solve()
