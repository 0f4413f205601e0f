"""The network solution of the inner loop, compiled; equations: `gridpeers.plant.dynamics.reduction.reduction`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridpeers.plant.dynamics.kernel.arithmetic import A120, multiply_add
from gridpeers.plant.dynamics.kernel.block_factors import solve_blocks
from gridpeers.plant.dynamics.kernel.compiled import compiled
from gridpeers.plant.dynamics.kernel.limited_load import limited_currents
from gridpeers.plant.dynamics.kernel.sparse import COPY, branch_voltages, draw_remainders

MAX_ITERATIONS = 60

CAUTION = 0.1
"""Part of the tolerance that what is left of an iteration may have by its rate so far."""

NOISE = 100.0
"""Change of an iteration, as a multiple of the tolerance, from which on the next one tells its rate, not rounding."""


@compiled
def load_currents(
    S: NDArray[np.complex128],
    I0: NDArray[np.complex128],
    limited_at: NDArray[np.int64],
    law: NDArray[np.float64],
    x: NDArray[np.float64],
    I_b: NDArray[np.complex128],
) -> None:
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
def remainder(current: complex, V_b: complex, i_c: complex, A: complex, B: complex) -> complex:
    """Return what a branch draws (A) beyond the tangent of its load at the voltage V_b (V)."""
    return current - i_c - A * V_b - B * V_b.conjugate()


@compiled
def solve_sparse(
    net: Any,
    J: NDArray[np.complex128],
    rotation: NDArray[np.complex128],
    x: NDArray[np.float64],
    I_b: NDArray[np.complex128],
    V: NDArray[np.complex128],
    tolerance: float,
) -> int:
    """Solve as `solve_network` does, with the factors of a sparse matrix."""
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


@compiled
def solve_network(
    net: Any,
    J: NDArray[np.complex128],
    rotation: NDArray[np.complex128],
    x: NDArray[np.float64],
    I_b: NDArray[np.complex128],
    V: NDArray[np.complex128],
    tolerance: float,
    work: NDArray[np.float64],
) -> int:
    """Solve for the terminal voltages; returns the iterations, or -1 if there is no finite solution to the tolerance.

    Parameters
    ----------
    net
        A `gridpeers.plant.dynamics.reduction.reduced.Reduced`.
    J
        Injections, n_inv x 3 (A).
    rotation
        exp(-j angle) into each island's frame.
    x
        Branch voltages in that frame (V), [Re; Im]: first guess, then solution.
    I_b
        Branch currents in that frame (A), written here.
    V
        Terminal voltages, n_inv x 3 (V), written here.
    tolerance
        Largest change of a branch voltage in the last iteration (V).
    work
        Room for 6 n_inv + 2 m + 2 m + 2 m + 6 n_inv numbers.
    """
    if net.sparse.constant.size:
        return solve_sparse(net, J, rotation, x, I_b, V, tolerance)
    n = J.shape[0]
    m = net.S.size
    n3, m2 = 3 * n, 2 * m
    j, base, trial, rest, V_G = (
        work[: 2 * n3],
        work[2 * n3 : 2 * n3 + m2],
        work[2 * n3 + m2 : 2 * n3 + 2 * m2],
        work[2 * n3 + 2 * m2 : 2 * n3 + 3 * m2],
        work[2 * n3 + 3 * m2 : 4 * n3 + 3 * m2],
    )
    for i in range(n):
        turn = rotation[net.inverter_island[i]]
        for phase in range(3):
            turned = J[i, phase] * turn
            j[phase * n + i], j[n3 + phase * n + i] = turned.real, turned.imag

    base[:] = net.x_c
    multiply_add(net.PT, j, 1.0, base)
    iterations = 0
    while m > 0:
        iterations += 1
        load_currents(net.S, net.I0, net.limited_at, net.law, x, I_b)
        for b in range(m):
            N = remainder(I_b[b], complex(x[b], x[m + b]), net.i_c[b], net.A[b], net.B[b])
            rest[b], rest[m + b] = N.real, N.imag
        trial[:] = base
        multiply_add(net.QT, rest, -1.0, trial)
        change = 0.0
        for b in range(m2):
            change = max(change, abs(trial[b] - x[b]))
            x[b] = trial[b]
        if change <= tolerance:
            break
        if iterations >= MAX_ITERATIONS or not change < 1e12:
            return -1

    V_G[:] = net.s_G
    multiply_add(net.GGT, j, 1.0, V_G)
    if m > 0:
        load_currents(net.S, net.I0, net.limited_at, net.law, x, I_b)
        for b in range(m):
            rest[b], rest[m + b] = I_b[b].real, I_b[b].imag
        multiply_add(net.GBT, rest, -1.0, V_G)
    size = 0.0
    for i in range(n):
        back = rotation[net.inverter_island[i]].conjugate()
        for phase in range(3):
            V[i, phase] = complex(V_G[phase * n + i], V_G[n3 + phase * n + i]) * back
            size += abs(V_G[phase * n + i]) + abs(V_G[n3 + phase * n + i])
    # not a number is no change either: the loop above takes it for converged
    return iterations if np.isfinite(size) else -1
