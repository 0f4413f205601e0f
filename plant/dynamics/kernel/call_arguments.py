"""The arguments of a call as machine code reads them: 8-byte words, one after the other.

A number is one word. An array is what numba has for one: who counts its references (nobody: 0, 0), number and size of
its elements, address, shape, strides. A tuple is its members.
"""

from __future__ import annotations

from itertools import count
from struct import Struct
from typing import Any

import numpy as np

KEPT = 8
"""Tuples whose words are kept, for they come again: the networks and inverters of the last calls."""

_NUMBERS = {int: "q", np.int64: "q", float: "d", np.float64: "d"}
_PACK = {own: Struct(code).pack for own, code in _NUMBERS.items()}
_PACK_ARRAY = tuple(Struct(f"{5 + 2 * dimensions}q").pack for dimensions in range(5))

_ROWS, _COLUMNS, _ALIGNED, _WRITEABLE = 0x1, 0x2, 0x100, 0x400
"""Flags of an array: contiguous by rows, by columns; what numba's arrays must be, and what its types tell apart."""

_kinds: dict[tuple[Any, ...], int] = {}
"""A number for each kind of tuple: its class, and the kinds of its members."""

_numbers = count()

_seen: dict[int, tuple[tuple[Any, ...], int, bytes]] = {}
"""Tuples by their id, with kind and words. Each is held here: nothing else has its id then, nor its arrays' place."""


class UnpackableError(TypeError):
    """An argument that is no number, no array, and no tuple of these."""


def pack(args: tuple[Any, ...]) -> tuple[tuple[Any, ...], bytes]:
    """Return the kinds of arguments, by which machine code is chosen, and their words; from any thread.

    A tuple that came before is not looked at again: its members and the place of its arrays do not change.

    Raises
    ------
    UnpackableError
        If only numba itself can take them.
    """
    kinds, words = [], []
    for arg in args:
        kind: Any = _NUMBERS.get(type(arg))
        if kind is not None:
            packed = _PACK[type(arg)](arg)
        elif (seen := _seen.get(id(arg))) is not None:
            _, kind, packed = seen
        else:
            kind, packed = _packed(arg)
        kinds.append(kind)
        words.append(packed)
    return tuple(kinds), b"".join(words)


def described(kinds: tuple[Any, ...]) -> str:
    """Return kinds as a text that is the same in every process."""
    return ", ".join(_described(kind) for kind in kinds)


def _packed(arg: Any) -> tuple[Any, bytes]:
    """Return kind and words of an argument."""
    own = type(arg)
    if own is np.ndarray:
        flags, shape = arg.flags.num, arg.shape
        if not flags & _ALIGNED or len(shape) >= len(_PACK_ARRAY):
            raise UnpackableError
        # Not `__array_interface__`: "typestr", a key of that dict, is interned anew each time, as nobody else holds it,
        # and CPython's table of interned names does not use such a place again. A plant of nine inverters filled the
        # table every 436 s, and each new one, of 2 MB, left 1.6 MB of holes in the heap.
        address = arg.ctypes.data
        words = _PACK_ARRAY[len(shape)](0, 0, arg.size, arg.itemsize, address, *shape, *arg.strides)
        return (arg.dtype, len(shape), flags & (_WRITEABLE | (flags & _ROWS or _COLUMNS))), words
    if own in _NUMBERS:
        return _NUMBERS[own], _PACK[own](arg)
    if not isinstance(arg, tuple):
        raise UnpackableError
    seen = _seen.get(id(arg))
    if seen is None:
        parts = [_packed(member) for member in arg]
        kind = own, *(part[0] for part in parts)
        seen = arg, _kinds.setdefault(kind, next(_numbers)), b"".join(part[1] for part in parts)
        if len(_seen) >= KEPT:
            _seen.clear()
        _seen[id(arg)] = seen
    return seen[1], seen[2]


def _described(kind: Any) -> str:
    if isinstance(kind, str):
        return kind
    if isinstance(kind, tuple):
        dtype, dimensions, flags = kind
        return f"{dtype!r}[{dimensions}] {flags:x}"
    own, *members = next(known for known, number in tuple(_kinds.items()) if number == kind)
    return f"{own.__module__}.{own.__qualname__}({', '.join(_described(member) for member in members)})"
