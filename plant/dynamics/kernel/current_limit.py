"""Phase-current limit of grid-forming inverters, compiled: a network solution within it (`inverter-models.md` 3.7).

A phase whose current is beyond the limit keeps its angle and loses the surplus: its injection becomes the one that
gives the limit at the voltage found. That moves the voltages, so limiting and solving alternate until both rest. As in
GridLAB-D this begins at the voltages of the last solution, and the injections only ever shrink: what remains may be
less than the limit, and depends on the way. To begin at the unlimited solution would be plainer, but differs a hundred
times more from GridLAB-D. The controller knows nothing of all this; its next pass gives the unlimited injection again.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from plant.dynamics.kernel.compiled import compiled
from plant.dynamics.kernel.solve import solve_network

MAX_LIMITING = 2000
"""Most rounds of one limiting. A lone inverter needs about a hundred: a limited current is no source of voltage."""


@compiled
def limit_currents(units: Any) -> float:
    """Reduce the injections of the phases beyond their limit; return the largest change of an internal voltage (V)."""
    J, V = units.J, units.V
    largest = 0.0
    for k in range(units.gfm_at.size):
        i = units.gfm_at[k]
        if not units.online[i]:
            continue
        former = units.gfm[k]
        y_f, limit = former.y_f, former.I_limit
        for phase in range(3):
            current = J[i, phase] - y_f * V[i, phase]
            square = current.real * current.real + current.imag * current.imag
            if square > limit * limit:
                surplus = current * (1.0 - limit / np.sqrt(square))
                J[i, phase] -= surplus
                largest = max(largest, abs(surplus / y_f))
                units.limiting[i] = True
    return largest


@compiled
def solve_within_limits(
    net: Any,
    units: Any,
    rotation: NDArray[np.complex128],
    x: NDArray[np.float64],
    I_b: NDArray[np.complex128],
    tolerance: float,
    work: NDArray[np.float64],
) -> int:
    """Solve the network with every phase within its limit; return the iterations, or -1 as `solve_network`.

    Parameters
    ----------
    net, rotation, x, I_b, tolerance, work
        As for `solve_network`.
    units
        A `plant.dynamics.kernel.controller_pass.Units`: J and V are read and written, and `limiting` says whose J was
        reduced.
    """
    units.limiting[:] = False
    limit_currents(units)
    total = solve_network(net, units.J, rotation, x, I_b, units.V, tolerance, work)
    for _ in range(MAX_LIMITING):
        if total < 0 or limit_currents(units) <= tolerance:
            return total
        iterations = solve_network(net, units.J, rotation, x, I_b, units.V, tolerance, work)
        total = total + iterations if iterations >= 0 else -1
    return -1
