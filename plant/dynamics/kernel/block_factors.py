"""LU factors of a sparse matrix of 2 x 2 blocks, compiled: the real form of a network and of its loads' tangent.

A node's real and imaginary part stay together, so that a pivot is a block: the real form of a reactance alone has a
diagonal of zeros, but its blocks are regular. Blocks are (a, b, c, d) for [[a, b], [c, d]].
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridpeers.plant.dynamics.kernel.compiled import compiled

Integers = NDArray[np.int64]
Real = NDArray[np.float64]


class BlockFactors(NamedTuple):
    """A matrix of n x n blocks whose pattern is symmetric, as (L + 1) D (1 + D^-1 U); before, as its own blocks."""

    start: Integers
    """First entry of each node in `later`, n + 1."""
    later: Integers
    """Later nodes that each node is coupled with, ascending."""
    D: Real
    """Inverse pivots, n x 4; before, the diagonal."""
    L: Real
    """Blocks below the diagonal, [later, node], by columns."""
    U: Real
    """Blocks above it, [node, later], by rows."""


def no_factors() -> BlockFactors:
    """Return the factors of an empty matrix."""
    return BlockFactors(np.zeros(1, np.int64), np.zeros(0, np.int64), *(np.zeros((0, 4)) for _ in range(3)))


@compiled
def add_tangent(
    f: BlockFactors,
    first: Integers,
    second: Integers,
    across: Integers,
    a_first: Real,
    a_second: Real,
    A: NDArray[np.complex128],
    B: NDArray[np.complex128],
) -> None:
    """Add what branches draw, A V + B V^* (A), to a matrix before it is factored.

    Parameters
    ----------
    f
        The matrix; written.
    first, second, a_first, a_second
        Nodes of each branch, or -1, and the ratios with which they count.
    across
        Entry that couples the two nodes, or -1.
    A, B
        Factors of each branch (S).
    """
    for b in range(first.size):
        p, q, r, s = A[b].real + B[b].real, B[b].imag - A[b].imag, A[b].imag + B[b].imag, A[b].real - B[b].real
        for node, ratio in ((first[b], a_first[b]), (second[b], a_second[b])):
            if node >= 0:
                square = ratio * ratio
                f.D[node, 0] += square * p
                f.D[node, 1] += square * q
                f.D[node, 2] += square * r
                f.D[node, 3] += square * s
        if across[b] >= 0:
            product = a_first[b] * a_second[b]
            for entry in (f.L[across[b]], f.U[across[b]]):
                entry[0] += product * p
                entry[1] += product * q
                entry[2] += product * r
                entry[3] += product * s


@compiled
def subtract_product(to: Real, left: Real, right: Real) -> None:
    """Subtract the product of two blocks from a third."""
    to[0] -= left[0] * right[0] + left[1] * right[2]
    to[1] -= left[0] * right[1] + left[1] * right[3]
    to[2] -= left[2] * right[0] + left[3] * right[2]
    to[3] -= left[2] * right[1] + left[3] * right[3]


@compiled
def factorise_blocks(f: BlockFactors) -> bool:
    """Factorise a matrix in place, without pivoting; return whether its determinant is positive.

    A matrix that is singular has factors that are not finite.
    """
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
