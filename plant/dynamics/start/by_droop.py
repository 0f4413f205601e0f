"""The reactive powers at rest that droops and volt-var characteristics give at voltage set-points."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root

from gridpeers.plant.dynamics.error import PlantError
from gridpeers.plant.dynamics.reduction.blas import one_thread
from gridpeers.plant.dynamics.reduction.reduced import Complex, Real
from gridpeers.plant.dynamics.start.power_flow import PowerFlow
from gridpeers.plant.dynamics.start.volt_var_at_rest import DROOP, INSIDE, OVER, UNDER, VoltVarAtRest

MOST_BY_DIFFERENCES = 100
"""Inverters up to which a Jacobian by differences is worth its power flows, one an inverter; else Newton-Krylov."""

KRYLOV = {"fatol": 1e-12, "maxiter": 20, "jac_options": {"rdiff": 1e-6}}
"""Largest deviation (pu), most iterations of Newton's method (it takes 3 to 5), and its relative difference."""

MOST_ROUNDS = 100
"""Most rounds in which inverters may change their place at their dead bands; it takes 2 to 4 on our feeder."""


class DroopPowers(NamedTuple):
    """Injections, voltages and reactive powers at rest, and where each inverter rests on its characteristic."""

    J: Complex
    """Norton injections (A)."""
    V: Complex
    """Terminal voltages (V)."""
    Q: Real
    """pu."""
    on_droop: NDArray[np.bool_]
    """Inverters whose voltage is V_set - m_q q."""
    on_edge: NDArray[np.bool_]
    """Inverters on the edge of a dead band."""


def solve_by_droop(flow: PowerFlow, J: Complex, P: Real, Q: Real, V_set: Real, swing: NDArray[np.bool_]) -> DroopPowers:
    """Find the Q that each characteristic gives at its terminal's voltage.

    Parameters
    ----------
    flow
        The power flow of constant powers.
    J, Q
        First guesses of the injections (A) and reactive powers (pu).
    P, V_set
        Real powers and voltage set-points (pu).
    swing
        Inverters that hold their voltage, whatever their droop.

    Raises
    ------
    PlantError
        If there are none.
    """
    units = flow.units
    free = ~swing & flow.reduction.online
    limit = np.sqrt(np.maximum(units.S_max**2 - P**2, 0.0))
    low, high = np.maximum(-limit, units.Q_min), np.minimum(limit, units.Q_max)
    at_rest = VoltVarAtRest(V_set, units.m_q, units.db_UV, units.db_OV, units.from_edge, low, high)
    place = np.where(free, at_rest.first_places(), DROOP)
    for rounds in range(MOST_ROUNDS):
        J, V, Q = _at_places(flow, J, P, Q, at_rest, place, np.flatnonzero(free), swing)
        v = units.regulated(V, J - flow.y[:, None] * V)
        right = np.where(free, at_rest.next_places(place, v, Q, rounds), DROOP)
        if np.array_equal(right, place):
            deviation = V_set - v
            on_droop = (place == DROOP) & (low * units.m_q <= deviation) & (deviation <= high * units.m_q)
            on_droop &= at_rest.beyond(v) == deviation
            return DroopPowers(J, V, Q, on_droop | ~free, (place == UNDER) | (place == OVER))
        place = right
    raise PlantError(
        "no initial operating point: it is not found which GFL rest within their dead bands (db_UV_pu, db_OV_pu); "
        "try another V_set0"
    )


def _at_places(
    flow: PowerFlow,
    J: Complex,
    P: Real,
    Q: Real,
    at_rest: VoltVarAtRest,
    place: NDArray[np.int64],
    free: NDArray[np.int64],
    swing: NDArray[np.bool_],
) -> tuple[Complex, Complex, Real]:
    """Find the Q at which the free inverters rest at these places of their characteristics."""
    if not free.size:  # swings alone: they hold their voltage, and nothing is left to find
        return *flow.solve(J, P, Q, swing), Q
    units = flow.units

    def mismatch(change: Real) -> Real:
        nonlocal J
        trial = Q.copy()
        trial[free] += change  # from 0: differences relative to a Q near 0 would vanish
        J, V = flow.solve(J, P, trial, swing)
        I_out = J - flow.y[:, None] * V
        measured = np.where(units.positive_sequence, units.measured(V, I_out)[0].imag, trial)
        return np.asarray(at_rest.mismatch(place, units.regulated(V, I_out), measured)[free])

    solution = None
    if free.size > MOST_BY_DIFFERENCES:
        with one_thread():
            solution = root(mismatch, np.zeros(free.size), method="krylov", options=KRYLOV)
    if solution is None or not solution.success:
        solution = root(mismatch, np.zeros(free.size), method="hybr", options={"xtol": 1e-13})
    if not solution.success and float(np.max(np.abs(solution.fun))) > 1e-10:
        raise PlantError(
            "no initial operating point: V_set0 cannot be met by droop, "
            f"mismatch {np.max(np.abs(solution.fun)):.1e} pu; try another V_set0"
        )
    Q = Q.copy()
    Q[free] += solution.x
    Q = np.where(place == INSIDE, at_rest.within(), Q)
    J, V = flow.solve(J, P, Q, swing)
    return J, V, Q
