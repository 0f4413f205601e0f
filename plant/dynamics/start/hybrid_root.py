"""Roots by Powell's hybrid method: MINPACK, as `scipy.optimize.root` calls it.

To import scipy.optimize takes 0.1 s, four times as long as to build a plant, for one of its forty solvers. So that one
is loaded by itself. It is none of scipy's public names: where it is not as before, scipy.optimize is imported.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader, FileFinder
from importlib.util import find_spec, module_from_spec
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]

_NAME = "scipy.optimize._minpack"

_JACOBIAN_BY_DIFFERENCES, _STEP_BOUND, _CONVERGED = -10, 100, 1
"""What `scipy.optimize.root` gives and takes: no bands in the Jacobian, MINPACK's `factor`, and its `info`."""


class Root(NamedTuple):
    """Where the method ended."""

    x: Real
    fun: Real
    """Values of the function at `x`."""
    success: bool


def hybrid_root(function: Callable[[Real], Real], guess: Real, xtol: float) -> Root:
    """Find a root of as many equations as unknowns; the same calls and bytes as `root(method="hybr")` of scipy.

    Parameters
    ----------
    function : Callable
        Equations of the unknowns; not called with a wish to keep its argument.
    guess : float64[n]
        Where to begin.
    xtol : float
        Relative change of the unknowns at which to end.
    """
    hybrd = _hybrd()
    if hybrd is None:
        from scipy.optimize import root

        found = root(function, guess, method="hybr", options={"xtol": xtol})
        return Root(found.x, found.fun, bool(found.success))
    function(guess)  # as scipy, which looks at the sizes: a function may go on from its last call
    most, precision = 200 * (guess.size + 1), float(np.finfo(float).eps)
    bands = _JACOBIAN_BY_DIFFERENCES, _JACOBIAN_BY_DIFFERENCES
    x, info, status = hybrd(function, guess.flatten(), (), 1, xtol, most, *bands, precision, _STEP_BOUND, None)
    return Root(x, info["fvec"], status == _CONVERGED)


def _hybrd() -> Any:
    """Return MINPACK's function; None if scipy does not have it where it was."""
    module = sys.modules.get(_NAME)
    if module is None:
        package = find_spec("scipy.optimize")
        places = None if package is None else package.submodule_search_locations
        finder = FileFinder(places[0], (ExtensionFileLoader, EXTENSION_SUFFIXES)) if places else None
        found = finder.find_spec(_NAME) if finder else None
        if found is None or found.loader is None:
            return None
        module = module_from_spec(found)
        found.loader.exec_module(module)
        sys.modules[_NAME] = module  # scipy.optimize takes it from here
    return getattr(module, "_hybrd", None)
