"""How the plant's inner loop is compiled: numba, cached on disk under a name that changes with the source.

Numba's cache looks only at the file of the function that is called, not at the files of the functions which
that one calls: after an edit in `gfm.py` the old `step.py` kernel would still be loaded. So the cache
folder carries a hash of all files of this package.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

import numba

_P = ParamSpec("_P")
_R = TypeVar("_R")

_HERE = Path(__file__).parent


def cache_folder() -> str:
    """Folder of this source's kernels: beside the source, or the user's cache where that is read-only."""
    digest = hashlib.sha256()
    for source in sorted(_HERE.glob("*.py")):
        digest.update(source.read_bytes())
    beside = _HERE / "__pycache__"
    if os.access(beside if beside.exists() else _HERE, os.W_OK):
        base = beside
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "gridpeers"
    return str(base / f"kernels-{digest.hexdigest()[:16]}")


if not os.environ.get("NUMBA_CACHE_DIR"):
    numba.config.CACHE_DIR = cache_folder()  # type: ignore[attr-defined]  # numba.config fills itself at import


def compiled(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile a function at its first call and keep the machine code on disk.

    No fast-math: sums keep their order, so the same inputs give the same bytes in every process.
    """
    return cast("Callable[_P, _R]", cast(Any, numba.njit)(cache=True, error_model="numpy")(function))


def unlocked(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile as `compiled` does a function that other threads may run beside."""
    return cast("Callable[_P, _R]", cast(Any, numba.njit)(cache=True, error_model="numpy", nogil=True)(function))
