"""A network by sparse factors in the inner loop, compiled: the factors, and where branches and inverters are."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridpeers.plant.dynamics.kernel.block_factors import BlockFactors, Integers, Real, no_factors
from gridpeers.plant.dynamics.kernel.compiled import compiled

COPY = -2
"""In place of the position of a terminal that copies the first one of its single-phase inverter."""


class SparseMaps(NamedTuple):
    """A network by sparse factors for the inner loop.

    Unknowns are node voltages, [Re V_1, Im V_1, Re V_2, ...].
    """

    factored: BlockFactors
    """Of the admittances and the loads' tangent."""
    constant: Real
    """Right-hand side (A) without injections: sources, and the constant part of the tangent."""
    first: Integers
    """Position of the node at each branch's beginning, or -1: at a source."""
    second: Integers
    """The same at its end, or -1: ground, or a source."""
    a_first: Real
    """Ratio with which the first node's voltage counts in the branch's."""
    a_second: Real
    """The same for the second."""
    from_sources: NDArray[np.complex128]
    """Part of each branch's voltage that the ideal sources give (V)."""
    terminals: Integers
    """Positions of the inverters' terminals, n_inv x 3, or -1; `COPY` for a copy of an inverter's first terminal."""
    fixed: NDArray[np.complex128]
    """Voltages (V) of the terminals that have no position: a source's, or 0."""
    feeds: NDArray[np.bool_]
    """Which inverters inject."""
    scratch: Real
    """Room for the solution and its right-hand side."""
    increments: Real
    """How the branch voltages changed from one solution to the next (V), 4 x 2 m, the last one last."""
    rate: Real
    """Part of an iteration's change that the next one has, when last seen, 1: unknown; and how much it can grow by a
    change of the branch voltages (1/V), for it is proportional to their distance from the tangent's."""


def no_maps() -> SparseMaps:
    """Return the maps of a network that is solved by dense matrices."""
    nowhere, values = np.zeros(0, np.int64), np.zeros(0)
    terminals, fixed = np.zeros((0, 3), np.int64), np.zeros((0, 3), np.complex128)
    none = np.zeros(0, np.complex128)
    held, increments = np.zeros(0, np.bool_), np.zeros((4, 0))
    return SparseMaps(
        no_factors(),
        values,
        nowhere,
        nowhere,
        values,
        values,
        none,
        terminals,
        fixed,
        held,
        values,
        increments,
        values,
    )


NO_MAPS = no_maps()


@compiled
def branch_voltages(maps: SparseMaps, V: Real, x: Real) -> float:
    """Write [Re V_b; Im V_b] of the branches (V) from the nodes' voltages; return the largest change (V)."""
    first, second, a_first, a_second = maps.first, maps.second, maps.a_first, maps.a_second
    from_sources = maps.from_sources
    m = first.size
    change = 0.0
    for b in range(m):
        re, im = from_sources[b].real, from_sources[b].imag
        i, j = 2 * first[b], 2 * second[b]
        if i >= 0:
            re += a_first[b] * V[i]
            im += a_first[b] * V[i + 1]
        if j >= 0:
            re += a_second[b] * V[j]
            im += a_second[b] * V[j + 1]
        change = max(change, abs(re - x[b]), abs(im - x[m + b]))
        x[b], x[m + b] = re, im
    return change


@compiled
def draw_remainders(
    maps: SparseMaps,
    I_b: NDArray[np.complex128],
    i_c: NDArray[np.complex128],
    A: NDArray[np.complex128],
    B: NDArray[np.complex128],
    x: Real,
    right: Real,
) -> None:
    """Take what the branches draw (A) beyond the loads' tangent from the nodes at their ends.

    Parameters
    ----------
    maps
        The network.
    I_b
        Currents of the branches (A) at x.
    i_c, A, B
        The tangent; see `gridpeers.plant.dynamics.reduction.reduced.Reduced`.
    x
        [Re V_b; Im V_b] of the branches (V).
    right
        Currents into the nodes (A); written.
    """
    first, second, a_first, a_second = maps.first, maps.second, maps.a_first, maps.a_second
    m = first.size
    for b in range(m):
        re, im = x[b], x[m + b]
        p, q = A[b].real + B[b].real, B[b].imag - A[b].imag
        r, s = A[b].imag + B[b].imag, A[b].real - B[b].real
        drawn_re = I_b[b].real - i_c[b].real - (p * re + q * im)
        drawn_im = I_b[b].imag - i_c[b].imag - (r * re + s * im)
        i, j = 2 * first[b], 2 * second[b]
        if i >= 0:
            right[i] -= a_first[b] * drawn_re
            right[i + 1] -= a_first[b] * drawn_im
        if j >= 0:
            right[j] -= a_second[b] * drawn_re
            right[j + 1] -= a_second[b] * drawn_im


@compiled
def extrapolate(maps: SparseMaps, x: Real) -> None:
    """Guess the next solution x (V): predictor and corrector alternate, so changes follow those two solutions ago."""
    increments = maps.increments
    for i in range(increments.shape[1]):
        x[i] += 2.0 * increments[2, i] - increments[0, i]


@compiled
def note_increment(maps: SparseMaps, x_0: Real, x: Real) -> None:
    """Note how a solution x differs from the one before, x_0 (V)."""
    increments = maps.increments
    for i in range(increments.shape[1]):
        increments[0, i], increments[1, i], increments[2, i] = increments[1, i], increments[2, i], increments[3, i]
        increments[3, i] = x[i] - x_0[i]
