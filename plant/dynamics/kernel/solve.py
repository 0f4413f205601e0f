"""The network solution of the inner loop, compiled; equations: `gridpeers.plant.dynamics.reduction`.

With the law of imported loads, and the fixed point between the network and inverters of constant power.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from gridpeers.plant.dynamics.kernel.compiled import A120, Complex, Flags, Integers, Real, compiled
from gridpeers.plant.dynamics.kernel.network_arrays import COPY, branch_voltages, draw_remainders, solve_blocks

COLUMNS = ("P", "Q", "V_nom", "n_p", "n_q", "V_low", "V_min", "V_max", "edge", "V_off", "V_off_above")
"""Columns of `law`: P (W), Q (var), voltages (V), and the exponents n_p, n_q and edge; see `LoadPart`."""


STEEPNESS = 500.0  # of the hyperbolic tangent by which a load drops out (1/pu), as in OpenDSS


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
def limited_admittance(row: Real, V: float) -> tuple[complex, complex]:
    """Return a load's admittance I / V (S) at a magnitude of its voltage (V), and its slope (S/V)."""
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
def limited_currents(at: Integers, law: Real, x: Real, I_b: Complex) -> None:
    """Write the currents (A) of the branches `at`, one for each row of `law`, at x = [Re V_b; Im V_b]."""
    m = I_b.size
    for k in range(at.size):
        b = at[k]
        re, im = x[b], x[m + b]
        I_b[b] = limited_admittance(law[k], np.sqrt(re * re + im * im))[0] * complex(re, im)


@compiled
def limited_tangents(at: Integers, law: Real, V: Complex, A: Complex, B: Complex) -> None:
    """Write the factors (S) by which the branches' currents follow their voltages (V) and these conjugate."""
    for k in range(at.size):
        b = at[k]
        magnitude = abs(V[b])
        g, slope = limited_admittance(law[k], magnitude)
        A[b] = g + 0.5 * slope * magnitude
        B[b] = 0.5 * slope * V[b] * V[b] / magnitude if magnitude > 0.0 else 0.0j


MAX_ITERATIONS = 60
CAUTION = 0.1  # part of the tolerance that all later changes together may have, by the rate so far
NOISE = 100.0  # change (tolerances) above which the next change shows the rate of convergence, not rounding


@compiled
def load_currents(S: Complex, I0: Complex, limited_at: Integers, law: Real, x: Real, I_b: Complex) -> None:
    """Write the branch currents (A) of all loads at x = [Re V_b; Im V_b]."""
    m = S.size
    if limited_at.size < m:
        for b in range(m):
            re, im = x[b], x[m + b]
            per_square = 1.0 / (re * re + im * im)
            per_V = np.sqrt(per_square)
            # (S/V)* + I0 V/|V| = g V; in real numbers, because numba's complex division branches
            g = S[b].real * per_square + I0[b].real * per_V
            h = I0[b].imag * per_V - S[b].imag * per_square
            I_b[b] = complex(g * re - h * im, g * im + h * re)
    limited_currents(limited_at, law, x, I_b)


@compiled
def solve_network(net: Any, J: Complex, rotation: Complex, x: Real, I_b: Complex, V: Complex, tolerance: float) -> int:
    """Solve for the terminal voltages; returns the iterations, or -1 if there is no finite solution to the tolerance.

    `rotation`: exp(-j angle) into each island's frame; `x`, `I_b`: branch voltages (V) and currents (A) in it: first
    guess, then solution; `tolerance`: largest change of a branch voltage in the last iteration (V).
    """
    maps = net.sparse
    n, u = J.shape[0], maps.constant.size
    right, base = maps.scratch[:u], maps.scratch[u:]
    base[:] = maps.constant
    for i in range(n):
        if maps.feeds[i]:
            turn = rotation[net.inverter_island[i]]
            for phase in range(3):
                at = maps.terminals[i, phase]
                if at >= 0:
                    turned = J[i, phase] * turn
                    base[2 * at] += turned.real
                    base[2 * at + 1] += turned.imag
    rate = maps.rate
    iterations, former = 0, 0.0
    while True:
        iterations += 1
        load_currents(net.S, net.I0, net.limited_at, net.law, x, I_b)
        right[:] = base
        draw_remainders(maps, I_b, net.i_c, net.A, net.B, x, right)
        solve_blocks(maps.factored, right)
        change = branch_voltages(maps, right, x)
        if former > NOISE * tolerance:
            rate[0] = change / former
        else:
            rate[0] += change * rate[1]
        # the changes fall in a geometric series: what would follow is bounded by its sum
        if change <= tolerance or change * rate[0] <= CAUTION * tolerance * (1.0 - rate[0]):
            break
        if iterations >= MAX_ITERATIONS or not change < 1e12:
            return -1
        former = change
    size = 0.0
    for i in range(n):
        back = rotation[net.inverter_island[i]].conjugate()
        for phase in range(3):
            at = maps.terminals[i, phase]
            V[i, phase] = complex(right[2 * at], right[2 * at + 1]) * back if at >= 0 else maps.fixed[i, phase]
            size += abs(V[i, phase].real) + abs(V[i, phase].imag)
        if maps.terminals[i, 1] == COPY:
            V[i, 1], V[i, 2] = V[i, 0] * A120.conjugate(), V[i, 0] * A120
    return iterations if np.isfinite(size) else -1


EXACT, SETTLED = 1e-13, 1e-11
"""Largest change of an injection (pu of its rated current) at which to end: at once, and after `PATIENCE`."""

PATIENCE = 100
NO_NETWORK = -1  # result of `settle_powers` where the network has no solution at the injections


@compiled
def settle_powers(
    most: int,
    net: Any,
    J: Complex,
    S: Complex,
    y: Complex,
    rated: Real,
    delivers: Flags,
    balanced: Flags,
    x: Real,
    I_b: Complex,
    V: Complex,
    tolerance: float,
) -> tuple[int, float]:
    """Find the injections with which every inverter delivers its power; return the rounds taken, and the last change.

    The change is that of an injection (pu of its rated current). Where they have not settled, `most` + 1 is returned;
    where the network has no solution, `NO_NETWORK`. `J` (A): first guess, then solution; `S`: powers of three phases
    (VA); `y`: admittances of the inverters that are part of the network (S); `rated`: ratings over nominal voltages
    (A); `delivers`: inverters whose injection is to be found; `balanced`: those of equal powers.
    """
    n = J.shape[0]
    still = np.ones(net.leader.size, np.complex128)
    change = 0.0
    for rounds in range(1, most + 1):
        if solve_network(net, J, still, x, I_b, V, tolerance) < 0:
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
