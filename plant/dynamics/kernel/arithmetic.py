"""The small arithmetic that the inverter models share, compiled."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridpeers.plant.dynamics.kernel.compiled import compiled

A120 = complex(-0.5, 0.5 * np.sqrt(3.0))
"""a = exp(j 120 deg)."""


@compiled
def sat(x: float, low: float, high: float) -> float:
    """Clip x to low..high."""
    return min(max(x, low), high)


@compiled
def magnitude(z: complex) -> float:
    """Return the magnitude of a phasor; `abs` takes three times as long, for numbers whose square overflows."""
    return float(np.sqrt(z.real * z.real + z.imag * z.imag))


@compiled
def unit_phasor(angle: float) -> complex:
    """Return exp(j angle), the angle in rad."""
    return complex(np.cos(angle), np.sin(angle))


@compiled
def heun(x0: float, d1: float, d: float, h: float, second: bool) -> float:
    """Predictor x0 + h d, or corrector x0 + h (d1 + d) / 2 in the second pass.

    Parameters
    ----------
    x0
        State at the start of the step.
    d1
        Slope of the first pass; not read in the first pass.
    d
        Slope of this pass.
    h
        Step (s).
    second
        Whether this is the corrector.
    """
    if second:
        return x0 + 0.5 * h * (d1 + d)
    return x0 + h * d


@compiled
def multiply_add(AT: NDArray[np.float64], x: NDArray[np.float64], sign: float, y: NDArray[np.float64]) -> None:
    """Add sign * A x to y, A given transposed, in an order that depends on nothing but the sizes.

    A BLAS call may sum in another order with another number of threads or alignment; equal bytes across
    processes are worth more here. Rows of AT run along y, so the inner loop vectorises without
    reordering a sum; four at a time spare three quarters of the traffic on y.
    """
    rows, n = AT.shape
    whole = rows - rows % 4
    for j in range(0, whole, 4):
        x0 = sign * x[j]
        x1 = sign * x[j + 1]
        x2 = sign * x[j + 2]
        x3 = sign * x[j + 3]
        for i in range(n):
            y[i] += (AT[j, i] * x0 + AT[j + 1, i] * x1) + (AT[j + 2, i] * x2 + AT[j + 3, i] * x3)
    for j in range(whole, rows):
        xj = sign * x[j]
        for i in range(n):
            y[i] += AT[j, i] * xj
