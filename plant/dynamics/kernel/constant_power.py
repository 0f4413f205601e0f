"""The network between inverters of constant power, compiled: a fixed point (`inverter-models.md` section 7)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridpeers.plant.dynamics.kernel.arithmetic import A120
from gridpeers.plant.dynamics.kernel.compiled import compiled
from gridpeers.plant.dynamics.kernel.solve import solve_network

EXACT, SETTLED = 1e-13, 1e-11
"""Largest change of an injection (pu of its rated current) at which to end: at once, and after `PATIENCE`."""

PATIENCE = 100

NO_NETWORK = -1
"""Result of `settle_powers` where the network has no solution at the injections."""


@compiled
def settle_powers(
    most: int,
    net: Any,
    J: NDArray[np.complex128],
    S: NDArray[np.complex128],
    y: NDArray[np.complex128],
    rated: NDArray[np.float64],
    delivers: NDArray[np.bool_],
    balanced: NDArray[np.bool_],
    x: NDArray[np.float64],
    I_b: NDArray[np.complex128],
    V: NDArray[np.complex128],
    tolerance: float,
) -> tuple[int, float]:
    """Find the injections with which every inverter delivers its power; return the rounds taken, and the last change.

    The change is that of an injection (pu of its rated current). Where they have not settled, one round more than
    `most` is returned; where the network has no solution at the injections J, `NO_NETWORK`.

    Parameters
    ----------
    most
        Most rounds.
    net
        A `gridpeers.plant.dynamics.reduction.reduced.Reduced` of islands at rest.
    J
        Injections (A), n_inv x 3: first guess, then solution.
    S
        Powers of all three phases (VA).
    y
        Admittances of the inverters that are part of the network (S).
    rated
        Ratings over nominal voltages (A).
    delivers
        Inverters whose injection is to be found; the others keep theirs.
    balanced
        Inverters of equal powers, in place of a balanced injection.
    x, I_b, V, tolerance
        As in `solve_network`.
    """
    n = J.shape[0]
    work = np.empty(12 * n + 6 * net.S.size)
    still = np.ones(net.leader.size, np.complex128)
    change = 0.0
    for rounds in range(1, most + 1):
        if solve_network(net, J, still, x, I_b, V, tolerance, work) < 0:
            return NO_NETWORK, change
        if rounds > 1 and (change < EXACT or (rounds > PATIENCE and change < SETTLED)):
            return rounds, change
        change = 0.0
        for i in range(n):
            if not delivers[i]:
                continue
            V_1 = (V[i, 0] + A120 * V[i, 1] + A120.conjugate() * V[i, 2]) / 3.0
            if V_1 == 0.0:
                V_1 = 1.0 + 0.0j
            own = 0.0j
            for phase in range(3):
                own += V[i, phase] * (y[i] * V[i, phase]).conjugate()
            J_A = ((S[i] + own) / (3.0 * V_1)).conjugate()
            for phase in range(3):
                turn = 1.0 + 0.0j if phase == 0 else A120.conjugate() if phase == 1 else A120
                updated = J_A * turn
                if balanced[i]:
                    at = V[i, phase] if V[i, phase] != 0.0 else 1.0 + 0.0j
                    updated = (S[i] / (3.0 * at)).conjugate()
                change = max(change, abs(updated - J[i, phase]) / rated[i])
                J[i, phase] = updated
    return most + 1, change
