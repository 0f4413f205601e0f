"""Which island the inner loop does not solve, where its solution of all islands at once has failed."""

from __future__ import annotations

import numpy as np

from gridpeers.plant.dynamics.kernel.controller_pass import Units
from gridpeers.plant.dynamics.kernel.current_limit import MAX_LIMITING, limit_currents
from gridpeers.plant.dynamics.kernel.solve import solve_network
from gridpeers.plant.dynamics.reduction.reduced import Complex, Real, Reduced


def unsettled_island(net: Reduced, units: Units, x: Real, tolerance: float) -> int:
    """Return the island whose voltages still change most after as many iterations as the inner loop takes.

    Nothing but the work arrays of `net` is changed.

    Parameters
    ----------
    net
        Linearised at the present angles: all frames stand at 0.
    units
        Of which a network solution within the current limits has failed.
    x
        Where that solution began (V), [Re; Im] of all branches.
    tolerance
        Of a network solution (V).
    """
    x, J, V, limiting = x.copy(), units.J.copy(), units.V.copy(), units.limiting.copy()
    I_b, work = np.empty(x.size // 2, complex), np.empty(12 * len(J) + 3 * x.size)
    still = np.ones(net.leader.size, complex)
    with np.errstate(all="ignore"):  # what diverges is not finite in the end
        for _ in range(MAX_LIMITING):
            surplus = limit_currents(units.gfm, units.gfm_at, units.online, J, V, limiting)
            before = x.copy(), V.copy()
            status = solve_network(net, J, still, x, I_b, V, tolerance, work)
            if status < 0 or surplus <= tolerance:
                break
        if status < 0:  # the last iterations alone tell who diverges: those that have settled do not move again
            before = x.copy(), V.copy()
            solve_network(net, J, still, x, I_b, V, tolerance, work)
        change = np.zeros(net.leader.size)
        np.maximum.at(change, np.tile(net.branch_island, 2), _size(x - before[0]))
        np.maximum.at(change, net.inverter_island[units.online], _size(V - before[1]).max(axis=1)[units.online])
    return int(np.argmax(change))


def _size(change: Complex | Real) -> Real:
    return np.nan_to_num(np.abs(change), nan=np.inf)
