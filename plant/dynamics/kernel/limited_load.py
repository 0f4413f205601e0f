"""The law of `plant.imported_equipment.LoadPart`, compiled: power as any power of the voltage, within limits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from plant.dynamics.kernel.compiled import compiled

COLUMNS = ("P", "Q", "V_nom", "n_p", "n_q", "V_low", "V_min", "V_max", "edge", "V_off")
"""Columns of `law`: P (W), Q (var), voltages (V), and the exponents n_p, n_q and edge; see `LoadPart`."""


STEEPNESS = 500.0
"""How fast a load drops out around V_off: the hyperbolic tangent of this times the distance (pu), as in OpenDSS."""


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
    V_nom, V_low, V_off = row[2], row[5], row[9]
    if V_low >= V or V <= 0.0:
        return complex(row[0], -row[1]) / (V_nom * V_nom), 0.0j
    g, slope = _connected(row, V)
    if V_off > 0.0:
        t = np.tanh(STEEPNESS * (V - V_off) / V_nom)
        on = 0.5 * (1.0 + t)
        return g * on, slope * on + g * (0.5 * STEEPNESS / V_nom * (1.0 - t * t))
    return g, slope


@compiled
def _connected(row: NDArray[np.float64], V: float) -> tuple[complex, complex]:
    """Return the same above V_low, of a load that has not dropped out."""
    P, Q, V_nom, n_p, n_q, V_low, V_min, V_max, edge, _ = row
    nominal = complex(P, -Q) / (V_nom * V_nom)
    if V_min >= V:  # current in proportion: from the nominal impedance's at V_low to the load's own at V_min
        at_min = V_nom * (V_min / V_nom) ** (edge - 1.0)
        slope = (at_min - V_low) / (V_min - V_low)
        return nominal * ((V_low + slope * (V - V_low)) / V), nominal * ((slope - 1.0) * V_low / (V * V))
    if V_max > 0.0 and V_max < V:
        return nominal * (V_max / V_nom) ** (edge - 2.0), 0.0j
    m = V / V_nom
    p, q = P * m ** (n_p - 2.0), Q * m ** (n_q - 2.0)
    g = complex(p, -q) / (V_nom * V_nom)
    return g, complex((n_p - 2.0) * p, -(n_q - 2.0) * q) / (V_nom * V_nom * V)


@compiled
def limited_currents(
    at: NDArray[np.int64], law: NDArray[np.float64], x: NDArray[np.float64], I_b: NDArray[np.complex128]
) -> None:
    """Write the currents (A) of the branches `at`, one for each row of `law`, at x = [Re V_b; Im V_b]."""
    m = I_b.size
    for k in range(at.size):
        b = at[k]
        V = complex(x[b], x[m + b])
        I_b[b] = limited_admittance(law[k], abs(V))[0] * V


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
