"""Inverters set to rest at an operating point, and the limits within which they can."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridpeers.plant.dynamics.error import PlantError
from gridpeers.plant.dynamics.inverters import Inverters
from gridpeers.plant.dynamics.reduction.reduced import Real
from gridpeers.plant.dynamics.start.operating_point import OperatingPoint


def set_equilibrium(
    units: Inverters, point: OperatingPoint, online: NDArray[np.bool_], P: Real, V_set: Real | None
) -> None:
    """Set the inverters' set-points and controller states so that they rest at an operating point.

    Parameters
    ----------
    units
        The inverters; written.
    point
        Operating point.
    online
        Inverters that deliver; the others keep their states, with `P` and `V_set` as set-points.
    P, V_set
        Real powers and set-points of the point (pu). Without `V_set` a GFL rests at its voltage and its reactive power,
        V_set := v, Q_set := q; else all the reactive power comes from the droop, within dead band and limit.
    """
    S, v = units.measured(point.V, point.I)
    held = units.regulated(point.V, point.I)
    units.J, units.V, units.I = point.J.copy(), point.V.copy(), point.I.copy()
    for i in range(len(units)):
        if not online[i]:
            units.set_points[i] = P[i], 1.0 if V_set is None else V_set[i], 0.0
            continue
        if units.forming[i] or (V_set is not None and point.on_droop[i]):
            units.set_points[i] = S[i].real, held[i] + units.m_q[i] * S[i].imag, 0.0
        elif V_set is not None:
            units.set_points[i] = S[i].real, V_set[i], 0.0
        else:
            units.set_points[i] = S[i].real, v[i], S[i].imag
        units.rest(i, S[i], v[i])


def require_within_limits(units: Inverters, online: NDArray[np.bool_]) -> None:
    """Raise PlantError if the start is no equilibrium: a GFM that forms an island must be within its limits."""
    for k, i in enumerate(units.gfm_at.tolist()):
        if not online[i]:
            continue
        unit, limits, state = units.units[i], units.gfm[k], units.gfm_state[k]
        for what, value, base, symbol, low, high in (
            ("give", units.set_points[i, 0], unit.S_b / 1e3, "kW", "P_min", "P_max"),
            ("give", state["q"], unit.S_b / 1e3, "kvar", "Q_min", "Q_max"),
            ("have an internal voltage of", state["E"], 1.0, "pu", "E_min", "E_max"),
        ):
            if not limits[low] - 1e-9 <= value <= limits[high] + 1e-9:
                raise PlantError(
                    f"no equilibrium at t = 0: {unit.name} would have to {what} {value * base:.5g} {symbol}, "
                    f"it can from {limits[low] * base:.5g} to {limits[high] * base:.5g} {symbol} ({low}_pu, "
                    f"{high}_pu of [plant.gfm]); set another P_set0_pu or V_set0_pu, or change its load"
                )
        current, most = float(np.max(np.abs(units.I[i]))), float(limits["I_limit"])
        if current > most * (1.0 + 1e-9):
            raise PlantError(
                f"no equilibrium at t = 0: {unit.name} would have to carry {current:.5g} A in a phase, it can carry "
                f"{most:.5g} A (I_max_pu of [plant.gfm]); set another P_set0_pu, or change its load"
            )
