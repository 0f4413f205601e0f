"""Import scipy.sparse without the parts of numpy that nobody uses: for the process from which plants are forked.

Scipy keeps a copy of numpy's names, for which it imports also what numpy itself imports at its first use: its tests,
its Fortran compiler, its random numbers. They take half of the time of scipy.sparse. Here they stay away until somebody
uses them, of numpy or of the copy.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

COPY = "scipy._lib.array_api_compat.numpy"
"""Scipy's copy of numpy's names."""


def import_scipy_sparse() -> None:
    """Import scipy.sparse so; call it where there is no other thread, which could see numpy without these names."""
    numpy: Any = np
    names, listed = numpy.__all__, numpy.__dir__
    present = [name for name in names if name in vars(numpy)]
    numpy.__all__, numpy.__dir__ = present, lambda: present
    try:
        import scipy.sparse  # noqa: F401
    finally:
        numpy.__all__, numpy.__dir__ = names, listed
    copy: Any = sys.modules.get(COPY)
    if copy is not None and not hasattr(copy, "__getattr__"):
        copy.__getattr__ = lambda name: _lazily(copy, name)


def _lazily(copy: Any, name: str) -> Any:
    """Return a name of numpy that the copy of its names does not have yet."""
    if name not in np.__all__:
        raise AttributeError(f"module {COPY!r} has no attribute {name!r}")
    return getattr(np, name)
