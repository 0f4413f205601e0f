"""The plant's inner loop of second order, compiled: Heun's method for controllers and network as one DAE.

x' = f(x, y), 0 = g(x, y), with the controllers' states x, and the voltages and currents y. A step is the predictor x_1
= x_0 + h f(x_0, y_0) and the corrector x_0 + h/2 (f(x_0, y_0) + f(x_1, y_1)). At each of these states g = 0 is solved
for y, network and inverters' feed-forward together: the state space form of Hairer, Wanner, Solving Ordinary
Differential Equations II, VI.1. f is a pass of length 0 of the models. So nothing acts a pass late.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from gridpeers.plant.dynamics.kernel.compiled import Complex, Real, compiled
from gridpeers.plant.dynamics.kernel.controller_pass import advance_inverters, keep_start, read_offline, turn_frames
from gridpeers.plant.dynamics.kernel.network_arrays import extrapolate, note_increment
from gridpeers.plant.dynamics.kernel.step import FAILURES, solve_within_limits

CONSISTENT = 1e-10  # last change of a current between network and inverters (pu of rated current)
LOOSE = 0.01  # tolerance of a round's network solution, as a part of the round's change (pu voltage per pu current)
MAX_ROUNDS = 60


class FeedForward(NamedTuple):
    y: Complex
    """Admittance (S) between the internal voltage that a pass gives and the terminal; 0: a pass gives the current
    itself, or its internal voltage is a state and the admittance is part of the network."""
    gain: Complex  # 1 / (1 - a), where a is d i_after / d i_before of the current over a pass
    I_b: Real  # rated currents (A)
    V_b: float  # highest nominal voltage (V)


@compiled
def take_round(units: Any, forward: Any, used: Complex, change: Complex, readings: Real) -> float:
    """Write slopes, injections and their `change` (A) at the present voltages; return the largest one (pu)."""
    advance_inverters(units, 0.0, False, readings)
    largest = 0.0
    for i in range(units.online.size):
        if units.online[i]:
            for phase in range(3):
                own = units.J[i, phase] - forward.y[i] * units.V[i, phase]
                change[i, phase] = (own - used[i, phase]) * forward.gain[i]
                units.J[i, phase] = used[i, phase] + change[i, phase]
                largest = max(largest, abs(change[i, phase]) / forward.I_b[i])
    return largest


@compiled
def solve_together(
    net: Any, units: Any, forward: Any, rotation: Complex, x: Real, I_b: Complex, tolerance: float, readings: Real
) -> int:
    """Solve network and inverters at the present states; returns the iterations, or -1.

    An inverter's feed-forward of its own voltage and current is linear and solved in closed form. What remains is the
    current reference P / u_d, weighted by k_pc: each round gains a decade, and the secant through the last two rounds
    (Anderson acceleration of depth 1, each island by itself) two.
    """
    n, islands = units.online.size, net.leader.size
    J = units.J
    used, change = J.copy(), np.zeros_like(J)
    former, former_change = np.zeros_like(J), np.zeros_like(J)
    along, square = np.empty(islands), np.empty(islands)
    largest = take_round(units, forward, used, change, readings)  # at the former voltages: the first guess
    total = 0
    for count in range(MAX_ROUNDS):
        used[:] = J
        reach = max(tolerance, LOOSE * largest * forward.V_b)
        iterations = solve_within_limits(net, units, rotation, x, I_b, reach)
        if iterations < 0:
            return -1
        total += iterations if count == 0 else iterations - 1
        largest = take_round(units, forward, used, change, readings)
        if largest <= CONSISTENT:
            return total
        along[:] = 0.0
        square[:] = 0.0
        for i in range(n):
            k = net.inverter_island[i]
            for phase in range(3):
                bend = (change[i, phase] - former_change[i, phase]) / forward.I_b[i]
                along[k] += (bend.conjugate() * change[i, phase]).real / forward.I_b[i]
                square[k] += (bend.conjugate() * bend).real
        for i in range(n):
            k = net.inverter_island[i]
            part = along[k] / square[k] if count > 0 and square[k] > 0.0 else 0.0
            for phase in range(3):
                plain = J[i, phase]
                J[i, phase] = plain - part * (plain - former[i, phase])
                former[i, phase], former_change[i, phase] = plain, change[i, phase]
    return -1


@compiled
def run_second_order_steps(
    begin: int,
    steps: int,
    h: float,
    tolerance: float,
    net: Any,
    units: Any,
    present: Any,
    slope_0: Real,
    forward: Any,
    x: Real,
    out: Real,
) -> int:
    """Advance to the end of `steps` steps; returns, and resumes after a failure, as `step.run_steps` does.

    `begin`: solution to begin with: 2 k at the start of step k, 2 k + 1 at its predictor, 2 `steps` at the end;
    `present`: `units` with the present states in place of those at the start of the step; `slope_0`: room for slopes.
    """
    total = 0
    if steps == 0:
        return total
    n, m = units.J.shape[0], net.S.size
    I_b = np.empty(m, np.complex128)
    x_0, J_0 = np.empty_like(x), np.empty_like(units.J)
    rotation = np.empty(net.leader.size, np.complex128)
    unread = np.zeros_like(out[0])
    for solution in range(begin, 2 * steps + 1):
        step = solution // 2
        predicted = solution % 2 == 1
        ends = not predicted and step > 0
        readings = out[step - 1] if ends else unread
        x_0[:] = x
        J_0[:] = units.J
        if solution > 0:
            extrapolate(net.sparse, x)
        turn_frames(units, net, rotation)
        iterations = solve_together(net, present, forward, rotation, x, I_b, tolerance, readings)
        if iterations < 0:
            x[:] = x_0
            units.J[:] = J_0
            if not predicted:
                keep_start(units)
            return -1 - (FAILURES * step + solution % 2)
        if solution > 0:  # solution 0 repeats the last one of the steps before: it says nothing about the change
            note_increment(net.sparse, x_0, x)
        total += iterations
        if ends:
            read_offline(units, readings)
            for i in range(n):
                if units.online[i] and not np.isfinite(readings[i, 0]):
                    return -1 - (FAILURES * (step - 1) + 2)
        if predicted:
            units.state[:] = units.start + 0.5 * h * (slope_0 + units.slope)
        else:
            keep_start(units)
            if step < steps:
                slope_0[:] = units.slope
                units.state[:] = units.start + h * slope_0
    return total
