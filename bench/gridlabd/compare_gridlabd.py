"""Largest differences between two plants' rows of the same run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plant.equipment import InverterRow

QUANTITIES = {"f": "Hz", "P": "pu", "Q": "pu", "V": "pu", "P_set": "pu", "V_set": "pu"}
"""Quantities of each inverter in a row, and their units of comparison: pu of rating and of nominal voltage."""


class Largest(NamedTuple):
    """The largest difference of a quantity over all inverters and steps."""

    value: float
    """Magnitude, in the unit of `QUANTITIES`; nan if any difference is not a number."""
    inverter: str
    """Where it is."""
    t: float
    """When it is (s)."""
    span: tuple[float, float]
    """Smallest and largest value that the quantity takes in the first plant."""


def differences(
    first: Sequence[tuple[float, ...]], second: Sequence[tuple[float, ...]], units: Sequence[InverterRow]
) -> dict[str, Largest]:
    """Compare two plants step by step.

    Parameters
    ----------
    first, second
        Rows of `Plant.take_rows`, of the same times.
    units
        The inverters, in the rows' order.

    Raises
    ------
    ValueError
        If the rows are not of the same times.
    """
    t, ours = _arranged(first, units)
    t_second, theirs = _arranged(second, units)
    if not np.array_equal(t, t_second):
        raise ValueError(f"rows of {t.size} and {t_second.size} steps are not of the same times")
    found = {}
    for k, quantity in enumerate(QUANTITIES):
        gap = np.abs(ours[:, :, k] - theirs[:, :, k])
        step, i = np.unravel_index(np.argmax(gap), gap.shape)  # the first nan, if there is any
        span = float(ours[:, :, k].min()), float(ours[:, :, k].max())
        found[quantity] = Largest(float(gap[step, i]), units[int(i)].name, float(t[step]), span)
    return found


def _arranged(
    rows: Sequence[tuple[float, ...]], units: Sequence[InverterRow]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times (s), and steps x inverters x quantities in the units of `QUANTITIES`."""
    table = np.array(rows)
    P, V = (np.array([getattr(unit, name) for unit in units]) for name in ("P_rated", "V_nom"))
    bases = np.column_stack([np.ones(len(units)), P, P, V, P, V])
    return table[:, 0], table[:, 1:].reshape(len(table), len(units), len(QUANTITIES)) / bases
