"""The plant's inner loop of first order, compiled, as in GridLAB-D: two network solutions and two passes a step.

1. The events and set-points of t act.  2. Network solution N1 with the last injections.  3. Predictor of each inverter
from N1.  4. Network solution N2 with its injections.  5. Corrector from N2: states and injections of t + h. P, Q and V
of a reading are those of N2, f is that of the corrector. A lag T dx/dt = u - x has the slopes d1 = (u(N1) - x) / T and
d2 = (u(N2) - x1) / T at x1 = x + h d1, and ends at x + h (d1 + d2) / 2.

**Current limit.** A phase beyond the limit keeps its angle and loses the surplus: its injection becomes the one that
gives the limit at the voltage found. That moves the voltages, so limiting and solving alternate until both rest. As in
GridLAB-D this begins at the voltages of the last solution, and injections only ever shrink; beginning at the unlimited
solution differs a hundred times more. The controller knows nothing of this.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from gridpeers.plant.dynamics.kernel.compiled import Complex, Flags, Real, compiled
from gridpeers.plant.dynamics.kernel.controller_pass import advance_inverters, keep_start, read_offline, turn_frames
from gridpeers.plant.dynamics.kernel.network_arrays import extrapolate, note_increment
from gridpeers.plant.dynamics.kernel.solve import solve_network

MAX_LIMITING = 2000
"""Most rounds of one limiting. A lone inverter needs about a hundred: a limited current is no source of voltage."""


@compiled
def limit_currents(units: Any, J: Complex, V: Complex, limiting: Flags) -> float:
    """Reduce the injections of the phases beyond their limit; return the largest change of an internal voltage (V)."""
    largest = 0.0
    for i in range(units.online.size):
        y_f, limit = units.y_f[i], units.I_limit[i]
        if not units.online[i] or limit == np.inf:
            continue
        for phase in range(3):
            current = J[i, phase] - y_f * V[i, phase]
            square = current.real * current.real + current.imag * current.imag
            if square > limit * limit:
                surplus = current * (1.0 - limit / np.sqrt(square))
                J[i, phase] -= surplus
                largest = max(largest, abs(surplus / y_f))
                limiting[i] = True
    return largest


@compiled
def solve_on(net: Any, units: Any, rotation: Complex, x: Real, I_b: Complex, tolerance: float) -> int:
    """Solve until no phase is beyond its limit, after one was; return the iterations, or -1 as `solve_network`."""
    total = 0
    for _ in range(MAX_LIMITING):
        iterations = solve_network(net, units.J, rotation, x, I_b, units.V, tolerance)
        if iterations < 0:
            return -1
        total += iterations
        surplus = limit_currents(units, units.J, units.V, units.limiting)
        if surplus <= tolerance:
            return total
    return -1


@compiled
def solve_within_limits(net: Any, units: Any, rotation: Complex, x: Real, I_b: Complex, tolerance: float) -> int:
    """Solve the network with every phase within its limit; `step` has these lines in its loop, which is faster."""
    units.limiting[:] = False
    limit_currents(units, units.J, units.V, units.limiting)
    return solve_on(net, units, rotation, x, I_b, tolerance)


FAILURES = 3
"""What can fail in a step: 0 the first network solution, 1 the second, 2 a controller whose frequency is not finite."""


@compiled
def run_steps(begin: int, steps: int, h: float, tolerance: float, net: Any, units: Any, x: Real, out: Real) -> int:
    """Advance to the end of `steps` steps; returns the network iterations, or -1 - (FAILURES k + what) for step k.

    A solution that failed leaves everything as it stood before it: with another tangent in `net`, a call with `begin` =
    2 k + what goes on there. The start of step k is in `start` and `J_0` of the units. `x`: branch voltages in
    the islands' frames, the first guess of the next solution; `out`: steps x n_inv x READING: f of the corrector; P, Q
    and V of the second solution.
    """
    n, m = units.J.shape[0], net.S.size
    I_b = np.empty(m, np.complex128)
    x_0 = np.empty_like(x)
    rotation = np.empty(net.leader.size, np.complex128)
    total = 0
    for solution in range(begin, 2 * steps):
        step = solution // 2
        second = solution % 2 == 1
        if not second:
            keep_start(units)
        turn_frames(units, net, rotation)
        x_0[:] = x
        extrapolate(net.sparse, x)
        units.limiting[:] = False
        limit_currents(units, units.J, units.V, units.limiting)
        iterations = solve_network(net, units.J, rotation, x, I_b, units.V, tolerance)
        if iterations >= 0:
            surplus = limit_currents(units, units.J, units.V, units.limiting)
            if surplus > tolerance:
                more = solve_on(net, units, rotation, x, I_b, tolerance)
                iterations = iterations + more if more >= 0 else -1
        if iterations < 0:
            x[:] = x_0
            return -1 - (FAILURES * step + solution % 2)
        note_increment(net.sparse, x_0, x)
        total += iterations
        advance_inverters(units, h, second, out[step])
        if second:
            read_offline(units, out[step])
            for i in range(n):
                if units.online[i] and not np.isfinite(out[step, i, 0]):
                    return -1 - (FAILURES * step + 2)
    return total


@partial(compiled, nogil=True)
def run_steps_unlocked(
    begin: int, steps: int, h: float, tolerance: float, net: Any, units: Any, x: Real, out: Real
) -> int:
    """Do the same without Python's lock, for networks so large that it is worth handing it back and forth."""
    return run_steps(begin, steps, h, tolerance, net, units, x, out)
