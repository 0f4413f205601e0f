"""How the plant's inner loop is compiled, by numba once, whose cache keeps the machine code; and its small arithmetic.

Numba's own choice would be a folder beside the sources, and an error where it can write none.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Collection
from contextlib import suppress
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numpy as np
from numba import njit
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.runtime.nrt import rtsys
from numpy.typing import NDArray

from gridpeers.plant.inverters import inverter_model
from gridpeers.plant.inverters.inverter_model import A120 as A120

_P = ParamSpec("_P")
_R = TypeVar("_R")

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

HERE = Path(__file__).parent


def kernel_folder(of_models: Collection[str] = (inverter_model.__file__,)) -> Path | None:
    """Return where machine code of this folder, and of files of models, is kept; None where the user has no home.

    Its name carries a hash of them all, because an edit of `solve.py` changes the code of its callers in `step.py`.
    """
    sources = (*sorted(HERE.glob("*.py")), *map(Path, sorted(of_models)))
    digest = hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()
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
    """The folder of machine code for numba's cache; its name has the hash of the sources."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder

    @classmethod
    def from_function(cls, function: Any, _: Any) -> _Place:
        return cls(getattr(function, "kept_in", FOLDER))

    def ensure_cache_path(self) -> None:
        Path(self.get_cache_path()).mkdir(parents=True, exist_ok=True)

    def get_cache_path(self) -> str:
        return str(self._folder)

    def get_source_stamp(self) -> str:
        return ""

    def get_disambiguator(self) -> str:
        return ""


class _Files(CompileResultCacheImpl):
    _locator_classes = [_Place]  # type: ignore[list-item]  # noqa: RUF012


class KeptCode(FunctionCache):
    """Numba's cache in our folder, which may also be read-only or full."""

    _impl_class = _Files

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        with suppress(OSError):
            # The base class imports all that a compilation may need (0.3 s); kept code needs the allocator alone.
            rtsys.initialize(target_context)
            found = self._load_overload(sig, target_context)  # type: ignore[no-untyped-call]
            # Two processes that compile a function for two types at a time may both give their code the same file.
            same = found is not None and tuple(found.signature.args) == tuple(getattr(sig, "args", sig))
            return found if same else None
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
        dispatcher._cache = KeptCode(function)  # type: ignore[no-untyped-call]  # noqa: SLF001
    result: Callable[_P, _R] = dispatcher
    return result


def keep(code: Any, function: Any, sources: Collection[str]) -> None:
    """Keep the machine code of a function that calls those of files of models; a cell of a notebook has no file."""
    if FOLDER and all(map(os.path.isfile, sources)):
        function.kept_in = kernel_folder(sources)
        code._cache = KeptCode(function)  # type: ignore[no-untyped-call]  # noqa: SLF001


magnitude, unit_phasor = compiled(inverter_model.magnitude), compiled(inverter_model.unit_phasor)
