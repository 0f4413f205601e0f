"""How the plant's inner loop is compiled, by numba once, whose cache keeps the machine code; and its small arithmetic.

Numba's own choice would be a folder beside the sources, and an error where it can write none.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numpy as np
from numba import njit
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.runtime.nrt import rtsys
from numpy.typing import NDArray

_P = ParamSpec("_P")
_R = TypeVar("_R")

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

_HERE = Path(__file__).parent


def kernel_folder() -> Path | None:
    """Return where machine code of these sources is kept; None where the user has no home.

    Its name carries a hash of all files here, because an edit of `gfm.py` changes the code of its callers in `step.py`.
    """
    digest = hashlib.sha256(b"".join(source.read_bytes() for source in sorted(_HERE.glob("*.py")))).hexdigest()
    try:
        cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "gridpeers"
        base = Path(os.environ.get("NUMBA_CACHE_DIR") or cache)
    except RuntimeError:  # no HOME, and no entry in the list of users
        return None
    return base / f"kernels-{digest[:16]}" if base.is_absolute() else None


FOLDER = kernel_folder()


def is_compiled(function: str) -> bool:
    return FOLDER is not None and any(FOLDER.glob(f"*.{function}-*.nbi"))


class _Place:
    """The folder of machine code as numba's cache asks for it; its name tells the sources."""

    @classmethod
    def from_function(cls, *_: Any) -> _Place:
        return cls()

    def ensure_cache_path(self) -> None:
        Path(self.get_cache_path()).mkdir(parents=True, exist_ok=True)

    def get_cache_path(self) -> str:
        return str(FOLDER)

    def get_source_stamp(self) -> str:
        return ""

    def get_disambiguator(self) -> str:
        return ""


class _Files(CompileResultCacheImpl):
    _locator_classes = [_Place]  # type: ignore[list-item]  # noqa: RUF012


class _Cache(FunctionCache):
    """Numba's cache in our folder, which may also be read-only or full."""

    _impl_class = _Files

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        with suppress(OSError):
            # The base class imports all that a compilation may need (0.3 s); kept code needs the allocator alone.
            rtsys.initialize(target_context)
            found = self._load_overload(sig, target_context)  # type: ignore[no-untyped-call]
            # Two processes that compile a function for two types at a time may both give their code the same file.
            return found if found is not None and tuple(found.signature.args) == tuple(sig) else None
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        with suppress(OSError):
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]


def compiled(function: Callable[_P, _R], *, nogil: bool = False) -> Callable[_P, _R]:
    """Compile a function at its first call and keep the machine code on disk.

    No fast-math: sums keep their order, so the same inputs give the same bytes in every process.
    """
    dispatcher: Any = njit(error_model="numpy", nogil=nogil)(function)
    if FOLDER:  # `cache=True` would take one of numba's own folders
        dispatcher._cache = _Cache(function)  # type: ignore[no-untyped-call]  # noqa: SLF001
    result: Callable[_P, _R] = dispatcher
    return result


A120 = complex(-0.5, 0.5 * np.sqrt(3.0))  # a = exp(j 120 deg)


@compiled
def sat(x: float, low: float, high: float) -> float:
    return min(max(x, low), high)


@compiled
def magnitude(z: complex) -> float:
    """Return the magnitude of a phasor; `abs` takes three times as long, for numbers whose square overflows."""
    return float(np.sqrt(z.real * z.real + z.imag * z.imag))


@compiled
def unit_phasor(angle: float) -> complex:
    return complex(np.cos(angle), np.sin(angle))


@compiled
def heun(x0: float, d1: float, d: float, h: float, second: bool) -> float:
    """Return the predictor x0 + h d, or in the second pass the corrector x0 + h (d1 + d) / 2."""
    if second:
        return x0 + 0.5 * h * (d1 + d)
    return x0 + h * d
