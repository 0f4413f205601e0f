"""The plant's inner loop, compiled: two network solutions and two controller passes a step (section 5)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridpeers.plant.dynamics.kernel.compiled import compiled, unlocked
from gridpeers.plant.dynamics.kernel.controller_pass import advance_inverters, keep_start, read_offline, turn_frames
from gridpeers.plant.dynamics.kernel.current_limit import limit_currents, solve_on
from gridpeers.plant.dynamics.kernel.solve import solve_network
from gridpeers.plant.dynamics.kernel.sparse import extrapolate, note_increment

FAILURES = 3
"""What can fail in a step: 0 the first network solution, 1 the second, 2 a controller whose frequency is not finite."""


@compiled
def run_steps(
    begin: int,
    steps: int,
    h: float,
    tolerance: float,
    net: Any,
    units: Any,
    x: NDArray[np.float64],
    out: NDArray[np.float64],
) -> int:
    """Advance to the end of `steps` steps; returns the network iterations, or -1 - (FAILURES k + what) for step k.

    A solution that failed leaves everything as it stood before it: with another tangent in `net`, a call with
    `begin` = 2 k + what goes on there. The start of step k is in `gfm_0`, `gfl_0` and `J_0` of the units.

    Parameters
    ----------
    begin
        Network solution to begin with, two a step.
    steps, h
        Number of steps and their length (s).
    tolerance
        Of the network solution (V).
    net
        A `gridpeers.plant.dynamics.reduction.reduced.Reduced`.
    units
        A `gridpeers.plant.dynamics.kernel.controller_pass.Units`.
    x
        Branch voltages in the islands' frames, the first guess of the next solution.
    out
        steps x n_inv x READING: each step's f of the corrector; P, Q and V of the second solution.
    """
    n, m = units.J.shape[0], net.S.size
    work = np.empty(12 * n + 6 * m)
    I_b = np.empty(m, np.complex128)
    x_0 = np.empty_like(x)
    rotation = np.empty(net.leader.size, np.complex128)
    theta = np.zeros(n)
    total = 0
    for solution in range(begin, 2 * steps):
        step = solution // 2
        second = solution % 2 == 1
        if not second:
            keep_start(units)
        turn_frames(units, net, theta, rotation)
        x_0[:] = x
        extrapolate(net.sparse, x)
        units.limiting[:] = False
        limit_currents(units.gfm, units.gfm_at, units.online, units.J, units.V, units.limiting)
        iterations = solve_network(net, units.J, rotation, x, I_b, units.V, tolerance, work)
        if iterations >= 0:
            surplus = limit_currents(units.gfm, units.gfm_at, units.online, units.J, units.V, units.limiting)
            if surplus > tolerance:
                more = solve_on(net, units, rotation, x, I_b, tolerance, work)
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


@unlocked
def run_steps_unlocked(
    begin: int,
    steps: int,
    h: float,
    tolerance: float,
    net: Any,
    units: Any,
    x: NDArray[np.float64],
    out: NDArray[np.float64],
) -> int:
    """Do the same without Python's lock, for networks so large that it is worth handing it back and forth."""
    return run_steps(begin, steps, h, tolerance, net, units, x, out)
