"""Powell's hybrid method without the rest of scipy.optimize."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import root

from plant.dynamics.start import hybrid_root

Real = NDArray[np.float64]


def equations(x: Real) -> Real:
    """Two equations with a root near (1.36, 1.15)."""
    return np.array([x[0] ** 2 + x[1] - 3.0, np.cos(x[1]) - 0.3 * x[0]])


@pytest.mark.parametrize("beginning", [(1.0, 1.0), (50.0, -3.0)])
@pytest.mark.parametrize("alone", [True, False])
def test_it_is_scipys_own(beginning: tuple[float, float], alone: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same calls in the same order, and the same bytes, whether the solver can be loaded alone or not."""
    if not alone:
        monkeypatch.setattr(hybrid_root, "_hybrd", lambda: None)
    calls: dict[str, list[bytes]] = {"ours": [], "scipy": []}

    def noted(whose: str, x: Real) -> Real:
        calls[whose].append(x.tobytes())
        return equations(x)

    ours = hybrid_root.hybrid_root(lambda x: noted("ours", x), np.array(beginning), 1e-13)
    theirs = root(lambda x: noted("scipy", x), np.array(beginning), method="hybr", options={"xtol": 1e-13})

    assert calls["ours"] == calls["scipy"]
    assert ours.x.tobytes() == theirs.x.tobytes()
    assert ours.fun.tobytes() == theirs.fun.tobytes()
    assert ours.success == theirs.success


def test_a_plant_starts_without_scipy_optimize() -> None:
    """Its import takes longer than all the rest of a plant's build."""
    code = "import sys; from plant.loaded_kernels import load_kernels; load_kernels(); print(sorted(sys.modules))"

    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)

    assert "'scipy.optimize._minpack'" in done.stdout
    assert "'scipy.optimize'" not in done.stdout
