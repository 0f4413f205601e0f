"""The law of `gridpeers.plant.equipment.imported_equipment.LoadPart`, compiled: any power of the voltage in limits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridpeers.plant.dynamics.kernel.compiled import compiled

COLUMNS = ("P", "Q", "V_nom", "n_p", "n_q", "V_low", "V_min", "V_max", "edge", "V_off", "V_off_above")
"""Columns of `law`: P (W), Q (var), voltages (V), and the exponents n_p, n_q and edge; see `LoadPart`."""


STEEPNESS = 500.0
"""How fast a load drops out around V_off or V_off_above: the hyperbolic tangent of this times the distance (pu), as in
OpenDSS."""


@compiled
def power(m: float, n: float) -> float:
    """Return m to the power of n, which is a small integer for nearly every load: they need no logarithm."""
    if n == -2.0:
        return 1.0 / (m * m)
    if n == -1.0:
        return 1.0 / m
    if n == 0.0:
        return 1.0
    return float(m**n)


@compiled
def limited_admittance(row: NDArray[np.float64], V: float) -> tuple[complex, complex]:
    """Return a load's admittance I / V (S) at this magnitude of its voltage (V), and its slope (S/V).

    Parameters
    ----------
    row
        A row of `COLUMNS`.
    V
        Magnitude of the voltage across the load (V).
    """
    P, Q, V_nom, n_p, n_q, V_low, V_min, V_max, edge, V_off, V_off_above = row
    per_square = 1.0 / (V_nom * V_nom)
    if (V_low >= V and V_low != V_min) or V <= 0.0:
        return complex(P * per_square, -Q * per_square), 0.0j
    if V_min >= V and V_low == V_min:  # a current limit: as at V_min
        p = q = per_square * V_nom * power(V_min / V_nom, edge - 1.0) / V
        p_slope = q_slope = -p / V
    elif V_min >= V:  # current in proportion: from the nominal impedance's at V_low to the load's own at V_min
        at_min = V_nom * power(V_min / V_nom, edge - 1.0)
        rise = (at_min - V_low) / (V_min - V_low)
        p = q = per_square * (V_low + rise * (V - V_low)) / V
        p_slope = q_slope = per_square * (rise - 1.0) * V_low / (V * V)
    elif V_max > 0.0 and V_max < V:
        p = q = per_square * power(V_max / V_nom, edge - 2.0)
        p_slope = q_slope = 0.0
    else:
        p, q = per_square * power(V / V_nom, n_p - 2.0), per_square * power(V / V_nom, n_q - 2.0)
        p_slope, q_slope = (n_p - 2.0) * p / V, (n_q - 2.0) * q / V
    g, slope = complex(P * p, -Q * q), complex(P * p_slope, -Q * q_slope)
    for limit, steepness in ((V_off, STEEPNESS), (V_off_above, -STEEPNESS)):
        if limit > 0.0:
            t = np.tanh(steepness * (V - limit) / V_nom)
            on = 0.5 * (1.0 + t)
            g, slope = g * on, slope * on + g * (0.5 * steepness / V_nom * (1.0 - t * t))
    return g, slope


@compiled
def limited_currents(
    at: NDArray[np.int64], law: NDArray[np.float64], x: NDArray[np.float64], I_b: NDArray[np.complex128]
) -> None:
    """Write the currents (A) of the branches `at`, one for each row of `law`, at x = [Re V_b; Im V_b]."""
    m = I_b.size
    for k in range(at.size):
        b = at[k]
        re, im = x[b], x[m + b]
        I_b[b] = limited_admittance(law[k], np.sqrt(re * re + im * im))[0] * complex(re, im)


@compiled
def limited_tangents(
    at: NDArray[np.int64],
    law: NDArray[np.float64],
    V: NDArray[np.complex128],
    A: NDArray[np.complex128],
    B: NDArray[np.complex128],
) -> None:
    """Write the factors (S) by which the branches' currents follow their voltages (V) and these conjugate."""
    for k in range(at.size):
        b = at[k]
        magnitude = abs(V[b])
        g, slope = limited_admittance(law[k], magnitude)
        A[b] = g + 0.5 * slope * magnitude
        B[b] = 0.5 * slope * V[b] * V[b] / magnitude if magnitude > 0.0 else 0.0j
