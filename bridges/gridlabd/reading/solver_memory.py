"""GridLAB-D's objects and its solver's tables in memory, laid out as in version 6.0.0."""

from __future__ import annotations

import ctypes
from typing import Any

from gridpeers.bridges.gridlabd.process.delta_mode import GridlabdCore

STRIDE = 3
"""Doubles of a complex number in GridLAB-D's arrays: real part, imaginary part, notation."""

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
        """Return an object's address."""
        address: int | None = self._library.object_find_name(name)
        return address

    def stop_after(self, seconds: int) -> None:
        """Let the simulation end so long (s) after its first moment."""
        start, stop = (ctypes.c_int64.in_dll(self._library, f"global_{which}time") for which in ("start", "stop"))
        stop.value = start.value + seconds

    def head(self, name: str) -> Any:
        """Return an object's head; RuntimeError if this GridLAB-D lays it out in another way."""
        head = ObjectHead.from_address(self.find(name.encode()) or 0)
        if head.name != name.encode():
            raise RuntimeError("objects are not laid out as in GridLAB-D 6.0.0; install gridlabd==6.0.0")
        return head

    def has(self, name: str, key: str) -> bool:
        """Whether an object has a property."""
        return bool(self._library.object_get_addr(self.find(name.encode()), key.encode()))

    def object_of(self, name: str, key: str) -> str:
        """Return the name of an object that a property refers to, or an empty text."""
        address = _pointer.from_address(self._address(name, key)).value
        return ObjectHead.from_address(address).name.decode() if address else ""

    def bits(self, name: str, key: str) -> int:
        """Return a property that is a set of flags, or one of a list."""
        return ctypes.c_uint32.from_address(self._address(name, key)).value


def complexes(address: int | None, count: int) -> list[list[float]]:
    """Return an array of GridLAB-D's complex numbers as pairs; no address is zeros."""
    if not address:
        return [[0.0, 0.0]] * count
    values = (_double * (STRIDE * count)).from_address(address)
    return [[values[STRIDE * k], values[STRIDE * k + 1]] for k in range(count)]
