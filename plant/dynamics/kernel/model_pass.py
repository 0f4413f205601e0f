"""The compiled pass of each model of inverters, which the inner loop calls by its address.

So the loop is compiled once, for all models, and a model once, for all loops. Parameters and states of an inverter are
a row of a table; its model sees the row as a record.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.ccallback import CFunc
from numba.extending import intrinsic, register_jitable

from gridpeers.plant.dynamics.kernel.compiled import keep
from gridpeers.plant.inverters import inverter_model
from gridpeers.plant.inverters.inverter_model import COMPILED, InverterModel, UnitRating

TERMINAL = np.dtype(
    [
        *((name, "f8") for name in ("P_set", "V_set", "Q_set", "P", "Q", "V")),
        *((f"{quantity}_{phase}", "c16") for quantity in "VIJ" for phase in "ABC"),
    ]
)
"""What a pass reads and writes at its terminal: `InverterModel.advance`."""

THETA, W, F = range(3)
"""Columns of a state that every model has: angle (rad), speed relative to nominal (rad/s), frequency (Hz)."""


@cache
def state_of(model: type[InverterModel]) -> np.dtype[np.void]:
    return np.dtype([(name, "f8") for name in ("theta", "w", "f", *model.STATES)])


@cache
def parameters_of(model: type[InverterModel]) -> np.dtype[np.void]:
    """Return the record of a model's parameters: numbers and flags of its fields, and constants of its rating."""
    values = model().values(UnitRating(1.0, 1.0, 1.0, 1.0, 1.0), 0.0j)
    return np.dtype([(name, np.dtype(type(value))) for name, value in values.items()], align=True)


def _record(_: Any, address: Any, dtype: Any) -> Any:
    """Return the record at an address."""

    def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.inttoptr(values[0], context.get_value_type(signature.return_type))

    return dtype.dtype(address, dtype), code


record_at: Any = intrinsic(_record)


_PASS = types.void(*[types.intp] * 5, types.float64, types.boolean)
_PASS_OF_C = (_PASS.args, _PASS.return_type)


def _run_pass(_: Any, address: Any, g: Any, t: Any, x0: Any, x: Any, d: Any, h: Any, second: Any) -> Any:
    """Call the pass at an address with those of its records."""

    def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        kinds = [context.get_argument_type(kind) for kind in _PASS.args]
        function = builder.inttoptr(values[0], ir.FunctionType(ir.VoidType(), kinds).as_pointer())
        given = zip(_PASS.args, values[1:], strict=True)
        builder.call(function, [context.get_value_as_argument(builder, kind, value) for kind, value in given])
        return context.get_dummy_value()

    return types.void(types.intp, *_PASS.args), code


run_pass: Any = intrinsic(_run_pass)


_known: set[Any] = set()  # Functions that compiled code may call


@cache
def address_of(model: type[InverterModel]) -> int:
    """Compile a model's pass, or load its machine code; return its address."""
    advance, parameters, state = model.advance, parameters_of(model), state_of(model)

    def take(g: int, t: int, x0: int, x: int, d: int, h: float, second: bool) -> None:
        start, present, slopes = record_at(x0, state), record_at(x, state), record_at(d, state)
        advance(record_at(g, parameters), record_at(t, TERMINAL), start, present, slopes, h, second)

    for function in (advance, *COMPILED):
        if function not in _known:
            register_jitable(error_model="numpy")(function)
            _known.add(function)
    code: Any = CFunc(take, _PASS_OF_C, locals={}, options={"error_model": "numpy"})
    keep(code, take, {inverter_model.__file__, *(function.__code__.co_filename for function in _called(advance))})
    try:
        code.compile()
    except Exception as error:  # the compiler's, of what a pass of somebody's does
        raise ValueError(f"{model.__name__}: its pass `advance` cannot be compiled{_why(error)}") from None
    _kept.append(code)
    return int(code.address)


def _why(error: Exception) -> str:
    """Return where and why, as the compiler has it of the innermost function, at the end of a page on our own."""
    text = str(error).rpartition("Failed in nopython mode pipeline")[2]
    first = next((line.strip() for line in text.splitlines()[1:] if line.strip()), str(error))
    line = re.search(r'File "(?:[^"]*/)?([^"]+)", line (\d+)', text)
    where = f" ({line[1]}:{line[2]})" if line else ""
    advice = "; if it is a function of yours, decorate it with `compiled`" if first.startswith("Untyped global") else ""
    return f"{where}: {type(error).__name__}: {first[:300]}{advice}"


def _called(function: Any) -> Iterator[Any]:
    """Yield a function and all `compiled` ones that it calls."""
    yield function
    for name in function.__code__.co_names:
        other = function.__globals__.get(name)
        if callable(other) and other in COMPILED:
            yield from _called(other)


_kept: list[Any] = []  # Compiled passes: their machine code must outlive their addresses
