"""A network in the inner loop, by sparse factors.

The matrix has blocks of 2 x 2, a node's real and imaginary part: the real form of a reactance alone has a
diagonal of zeros, but its blocks are regular. Blocks are (a, b, c, d) for [[a, b], [c, d]].
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gridpeers.plant.dynamics.kernel.compiled import Complex, Flags, Integers, Real, compiled


class BlockFactors(NamedTuple):
    """A matrix of n x n blocks whose pattern is symmetric, as (L + 1) D (1 + D^-1 U); before, as its own blocks."""

    start: Integers  # first entry of each node in `later`, n + 1
    later: Integers  # later nodes that each node is coupled with, ascending
    D: Real  # inverse pivots, n x 4; before, the diagonal
    L: Real  # blocks below the diagonal, [later, node], by columns
    U: Real  # blocks above it, [node, later], by rows


@compiled
def add_tangent(f: BlockFactors, ends: Integers, ratios: Real, across: Integers, A: Complex, B: Complex) -> None:
    """Add what branches draw, A V + B V^* (A), to a matrix before it is factored.

    `across`: entries that couple a branch's nodes, pair by pair, or -1; the others as in `SparseMaps` and `Reduced`.
    """
    m, most = ends.shape
    for b in range(m):
        p, q, r, s = A[b].real + B[b].real, B[b].imag - A[b].imag, A[b].imag + B[b].imag, A[b].real - B[b].real
        pair = 0
        for e in range(most):
            node = ends[b, e]
            if node >= 0:
                square = ratios[b, e] * ratios[b, e]
                f.D[node, 0] += square * p
                f.D[node, 1] += square * q
                f.D[node, 2] += square * r
                f.D[node, 3] += square * s
            for other in range(e + 1, most):
                at = across[b, pair]
                pair += 1
                if at >= 0:
                    product = ratios[b, e] * ratios[b, other]
                    for entry in (f.L[at], f.U[at]):
                        entry[0] += product * p
                        entry[1] += product * q
                        entry[2] += product * r
                        entry[3] += product * s


@compiled
def subtract_product(to: Real, left: Real, right: Real) -> None:
    to[0] -= left[0] * right[0] + left[1] * right[2]
    to[1] -= left[0] * right[1] + left[1] * right[3]
    to[2] -= left[2] * right[0] + left[3] * right[2]
    to[3] -= left[2] * right[1] + left[3] * right[3]


@compiled
def factorise_blocks(f: BlockFactors) -> bool:
    """Factorise in place, without pivoting; return whether the determinant is positive. Singular: not finite."""
    positive = True
    for k in range(f.D.shape[0]):
        a, b, c, d = f.D[k]
        determinant = a * d - b * c
        if determinant < 0.0:
            positive = not positive
        f.D[k, 0], f.D[k, 1], f.D[k, 2], f.D[k, 3] = (
            d / determinant,
            -b / determinant,
            -c / determinant,
            a / determinant,
        )
        begin, end = f.start[k], f.start[k + 1]
        for s in range(begin, end):
            p, q, r, v = f.L[s]
            f.L[s, 0], f.L[s, 1] = p * f.D[k, 0] + q * f.D[k, 2], p * f.D[k, 1] + q * f.D[k, 3]
            f.L[s, 2], f.L[s, 3] = r * f.D[k, 0] + v * f.D[k, 2], r * f.D[k, 1] + v * f.D[k, 3]
        for s in range(begin, end):
            i = f.later[s]
            subtract_product(f.D[i], f.L[s], f.U[s])
            at = f.start[i]  # what two nodes after k share with k they are coupled by, too: both lists ascend
            for t in range(s + 1, end):
                while f.later[at] != f.later[t]:
                    at += 1
                subtract_product(f.U[at], f.L[s], f.U[t])
                subtract_product(f.L[at], f.L[t], f.U[s])
    return positive


@compiled
def solve_blocks(f: BlockFactors, x: Real) -> None:
    """Solve in place: right-hand side in, solution out, [Re, Im] of each node."""
    # indices without a sign need no test whether they count from the end; a pair of new values before either is written
    # is one vector operation, because then no write can change what is still to be read: together a third of the time
    start, later, D, L, U = f.start.view(np.uint64), f.later.view(np.uint64), f.D, f.L, f.U
    one, two = np.uint64(1), np.uint64(2)
    n = np.uint64(D.shape[0])
    for k in range(n):
        re, im = x[two * k], x[two * k + one]
        for s in range(start[k], start[k + one]):
            i = two * later[s]
            x[i], x[i + one] = x[i] - (L[s, 0] * re + L[s, 1] * im), x[i + one] - (L[s, 2] * re + L[s, 3] * im)
    row = n
    while row > 0:
        row -= one
        re, im = x[two * row], x[two * row + one]
        for s in range(start[row], start[row + one]):
            i = two * later[s]
            re, im = re - (U[s, 0] * x[i] + U[s, 1] * x[i + one]), im - (U[s, 2] * x[i] + U[s, 3] * x[i + one])
        x[two * row], x[two * row + one] = D[row, 0] * re + D[row, 1] * im, D[row, 2] * re + D[row, 3] * im


COPY = -2  # in place of the position of a terminal that copies the first one of its single-phase inverter


class SparseMaps(NamedTuple):
    """A network by sparse factors for the inner loop; its unknowns are [Re V_1, Im V_1, Re V_2, ...]."""

    factored: BlockFactors  # of the admittances and the loads' tangent
    constant: Real  # right-hand side (A) without injections: sources, and the constant part of the tangent
    ends: Integers  # positions of each branch's nodes, or -1: ground, or a source
    ratios: Real  # ratios with which their voltages count in the branch's
    from_sources: Complex  # part of each branch's voltage that the ideal sources give (V)
    terminals: Integers  # positions of terminals, n_inv x 3, or -1; `COPY` of an inverter's first terminal
    fixed: Complex  # voltages (V) of the terminals that have no position: a source's, or 0
    feeds: Flags  # which inverters inject
    scratch: Real  # room for the solution and its right-hand side
    increments: Real  # how the branch voltages changed from one solution to the next (V), 4 x 2 m, the last one last
    rate: Real
    """Part of an iteration's change that the next one has, when last seen, 1: unknown; and its growth by a change of
    the branch voltages (1/V), for it is proportional to their distance from the tangent's."""


@compiled
def branch_voltages(maps: SparseMaps, V: Real, x: Real) -> float:
    """Write [Re V_b; Im V_b] of the branches (V) from the nodes' voltages; return the largest change (V)."""
    ends, ratios, from_sources = maps.ends, maps.ratios, maps.from_sources
    m, most = ends.shape
    change = 0.0
    for b in range(m):
        re, im = from_sources[b].real, from_sources[b].imag
        for e in range(most):
            i = 2 * ends[b, e]
            if i >= 0:
                re += ratios[b, e] * V[i]
                im += ratios[b, e] * V[i + 1]
        change = max(change, abs(re - x[b]), abs(im - x[m + b]))
        x[b], x[m + b] = re, im
    return change


@compiled
def draw_remainders(maps: SparseMaps, I_b: Complex, i_c: Complex, A: Complex, B: Complex, x: Real, right: Real) -> None:
    """Take what branches draw (A) beyond the tangent at x = [Re V_b; Im V_b] from the currents into their nodes."""
    ends, ratios = maps.ends, maps.ratios
    m, most = ends.shape
    for b in range(m):
        re, im = x[b], x[m + b]
        p, q = A[b].real + B[b].real, B[b].imag - A[b].imag
        r, s = A[b].imag + B[b].imag, A[b].real - B[b].real
        drawn_re = I_b[b].real - i_c[b].real - (p * re + q * im)
        drawn_im = I_b[b].imag - i_c[b].imag - (r * re + s * im)
        for e in range(most):
            i = 2 * ends[b, e]
            if i >= 0:
                right[i] -= ratios[b, e] * drawn_re
                right[i + 1] -= ratios[b, e] * drawn_im


@compiled
def extrapolate(maps: SparseMaps, x: Real) -> None:
    """Guess the next solution x (V): predictor and corrector alternate, so changes follow those two solutions ago."""
    increments = maps.increments
    for i in range(increments.shape[1]):
        x[i] += 2.0 * increments[2, i] - increments[0, i]


@compiled
def note_increment(maps: SparseMaps, x_0: Real, x: Real) -> None:
    increments = maps.increments
    for i in range(increments.shape[1]):
        increments[0, i], increments[1, i], increments[2, i] = increments[1, i], increments[2, i], increments[3, i]
        increments[3, i] = x[i] - x_0[i]


class Reduced(NamedTuple):
    """A network at a tangent of its loads."""

    S: Complex  # constant power of the live branches (VA)
    I0: Complex  # constant current of the live branches (A)
    limited_at: Integers  # live branches with the law of a `LoadPart`
    law: Real  # their rows of `gridpeers.plant.dynamics.kernel.solve.COLUMNS`
    i_c: Complex  # tangent of the load law, constant part (A)
    A: Complex  # tangent, factor of V_b (S)
    B: Complex  # tangent, factor of V_b^* (S)
    branch_island: Integers  # island of each live branch
    inverter_island: Integers  # island of each inverter
    leader: Integers  # inverter whose angle sets each island's frame; -1: it does not rotate
    theta_lin: Real  # that inverter's angle at the point of linearisation (rad)
    sparse: SparseMaps
