"""Solution with the triangular factors of a sparse real matrix, compiled: scipy's SuperLU cannot be called there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import SuperLU, splu

from plant.dynamics.kernel.compiled import compiled

Integers = NDArray[np.int32]
Real = NDArray[np.float64]


class Factors(NamedTuple):
    """A matrix as L U of its rows and columns in another order; L has ones on its diagonal, which are left out."""

    row: Integers
    """Place of each row in L."""
    column: Integers
    """Place of each column in U."""
    L_start: Integers
    """First entry of each column of L."""
    L_row: Integers
    L_value: Real
    U_start: Integers
    """First entry of each column of U, its diagonal left out."""
    U_row: Integers
    U_value: Real
    diagonal: Real
    """Diagonal of U."""


def factors(lu: SuperLU) -> Factors:
    """Return a factorisation as the compiled solution wants it."""
    L, U = sp.csc_array(sp.tril(lu.L, -1)), sp.csc_array(sp.triu(lu.U, 1))
    return Factors(
        lu.perm_r.astype(np.int32),
        lu.perm_c.astype(np.int32),
        L.indptr.astype(np.int32),
        L.indices.astype(np.int32),
        L.data,
        U.indptr.astype(np.int32),
        U.indices.astype(np.int32),
        U.data,
        lu.U.diagonal(),
    )


def no_factors() -> Factors:
    """Return the factors of an empty matrix."""
    none, start, values = np.zeros(0, np.int32), np.zeros(1, np.int32), np.zeros(0)
    return Factors(none, none, start, none, values, start, none, values, values)


def factorise(matrix: sp.csc_array) -> SuperLU:
    """Factorise a matrix whose pattern is symmetric."""
    return splu(sp.csc_matrix(matrix), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})


@compiled
def solve_factored(f: Factors, right: Real, work: Real) -> None:
    """Solve for `right` in place.

    Parameters
    ----------
    f
        Factors of the matrix.
    right
        Right-hand side in, solution out.
    work
        Room for as many numbers.
    """
    n = right.size
    for i in range(n):
        work[f.row[i]] = right[i]
    for j in range(n):
        x = work[j]
        if x != 0.0:
            for k in range(f.L_start[j], f.L_start[j + 1]):
                work[f.L_row[k]] -= f.L_value[k] * x
    for j in range(n - 1, -1, -1):
        x = work[j] / f.diagonal[j]
        work[j] = x
        if x != 0.0:
            for k in range(f.U_start[j], f.U_start[j + 1]):
                work[f.U_row[k]] -= f.U_value[k] * x
    for i in range(n):
        right[i] = work[f.column[i]]


class SparseMaps(NamedTuple):
    """The network of a large feeder for the inner loop: its factored real form, and where branches and inverters are.

    Unknowns are node voltages, [Re V_1, Im V_1, Re V_2, ...].
    """

    factored: Factors
    """Of the admittances and the loads' tangent."""
    constant: Real
    """Right-hand side (A) without injections: sources, and the constant part of the tangent."""
    first: NDArray[np.int64]
    """Position of the node at each branch's beginning, or -1: at a source."""
    second: NDArray[np.int64]
    """The same at its end, or -1: ground, or a source."""
    a_first: Real
    """Ratio with which the first node's voltage counts in the branch's."""
    a_second: Real
    """The same for the second."""
    from_sources: NDArray[np.complex128]
    """Part of each branch's voltage that the ideal sources give (V)."""
    terminals: NDArray[np.int64]
    """Positions of the inverters' terminals, n_inv x 3, or -1."""
    fixed: NDArray[np.complex128]
    """Voltages (V) of the terminals that have no position: a source's, or 0."""
    feeds: NDArray[np.bool_]
    """Which inverters inject."""
    scratch: Real
    """Room for the solution and its work."""


def no_maps() -> SparseMaps:
    """Return the maps of a network that is solved by dense matrices."""
    nowhere, values = np.zeros(0, np.int64), np.zeros(0)
    terminals, fixed = np.zeros((0, 3), np.int64), np.zeros((0, 3), np.complex128)
    none = np.zeros(0, np.complex128)
    return SparseMaps(
        no_factors(), values, nowhere, nowhere, values, values, none, terminals, fixed, np.zeros(0, np.bool_), values
    )


NO_MAPS = no_maps()


@compiled
def branch_voltages(maps: SparseMaps, V: Real, x: Real) -> float:
    """Write [Re V_b; Im V_b] of the branches (V) from the nodes' voltages; return the largest change (V)."""
    m = maps.first.size
    change = 0.0
    for b in range(m):
        re, im = maps.from_sources[b].real, maps.from_sources[b].imag
        if maps.first[b] >= 0:
            re += maps.a_first[b] * V[2 * maps.first[b]]
            im += maps.a_first[b] * V[2 * maps.first[b] + 1]
        if maps.second[b] >= 0:
            re += maps.a_second[b] * V[2 * maps.second[b]]
            im += maps.a_second[b] * V[2 * maps.second[b] + 1]
        change = max(change, abs(re - x[b]), abs(im - x[m + b]))
        x[b], x[m + b] = re, im
    return change


@compiled
def draw(maps: SparseMaps, b: int, current: complex, right: Real) -> None:
    """Take a branch's current (A) from the nodes at its ends."""
    if maps.first[b] >= 0:
        right[2 * maps.first[b]] -= maps.a_first[b] * current.real
        right[2 * maps.first[b] + 1] -= maps.a_first[b] * current.imag
    if maps.second[b] >= 0:
        right[2 * maps.second[b]] -= maps.a_second[b] * current.real
        right[2 * maps.second[b] + 1] -= maps.a_second[b] * current.imag
