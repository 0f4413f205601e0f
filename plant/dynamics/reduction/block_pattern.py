"""Where the factors of a sparse network have entries, and in which order its nodes give the fewest of them."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from gridpeers.plant.dynamics.kernel.block_factors import BlockFactors, Integers, Real, add_tangent
from gridpeers.plant.dynamics.reduction.elimination import WEAK
from gridpeers.plant.dynamics.reduction.reduced import Complex


def elimination_order(Y: sp.csc_array, C: sp.csc_array) -> NDArray[np.int64]:
    """Return the order of the nodes, by minimum degree, in which elimination couples few of the others.

    Those without an own admittance come last: elimination of the others gives them one.

    Parameters
    ----------
    Y
        Admittances between the nodes (S).
    C
        Incidence of the load branches.
    """
    link = _links(Y, C)
    link = link + sp.diags_array(np.full(link.shape[0], float(link.shape[0])))  # regular, whatever the admittances
    if not link.shape[0]:
        return np.zeros(0, np.int64)
    lu = splu(sp.csc_matrix(link), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True, "DiagPivotThresh": 0.0})
    order = np.argsort(lu.perm_c).astype(np.int64)
    size = abs(Y)
    weak = size.diagonal() <= WEAK * np.maximum(*(size.max(axis=axis).toarray().ravel() for axis in (0, 1)))
    return np.concatenate([order[~weak[order]], order[weak[order]]])


class BlockPattern:
    """The matrix of a network as blocks [Re; Im] of its nodes, with room for its factors.

    Parameters
    ----------
    Y
        Admittances between the nodes (S), in the order of elimination; neither symmetric nor without stored zeros.
    C
        Incidence of the load branches, real: at most two nodes each.

    Attributes
    ----------
    first, second : int64[m]
        Nodes of each branch, or -1.
    a_first, a_second : float64[m]
        Ratios with which their voltages count in the branch's.
    """

    def __init__(self, Y: sp.csc_array, C: sp.csc_array) -> None:
        self.start, self.later = _filled(_links(Y, C))
        self._Y = self._blocks(Y)
        self.first, self.second, self.a_first, self.a_second = _ends(C)
        both = (self.first >= 0) & (self.second >= 0)
        self._across = np.full(both.size, -1, np.int64)
        self._across[both] = self._entry(self.first[both], self.second[both])

    def matrix(self, A: Complex, B: Complex, y: Complex | None = None) -> BlockFactors:
        """Return V -> (Y + diag(y)) V + C (A C' V + B C' V^*), to be factored in place.

        Parameters
        ----------
        A, B
            Of each branch (S).
        y
            Of each node (S).
        """
        f = self._Y._replace(D=self._Y.D.copy(), L=self._Y.L.copy(), U=self._Y.U.copy())
        if y is not None:
            f.D[:] += np.column_stack([y.real, -y.imag, y.imag, y.real])
        add_tangent(f, self.first, self.second, self._across, self.a_first, self.a_second, A, B)
        return f

    def _entry(self, i: NDArray[np.int64], j: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the entries of `later` that couple these nodes."""
        n = self.start.size - 1
        owner = np.repeat(np.arange(n), np.diff(self.start))
        held, wanted = owner * n + self.later, np.minimum(i, j) * n + np.maximum(i, j)
        at = np.searchsorted(held, wanted)
        assert np.array_equal(held.take(at, mode="clip"), wanted), "nodes are coupled that the pattern does not couple"
        return at

    def _blocks(self, Y: sp.csc_array) -> BlockFactors:
        n, count = Y.shape[0], self.later.size
        D, L, U = np.zeros((n, 4)), np.zeros((count, 4)), np.zeros((count, 4))
        entries = sp.coo_array(Y)
        entries.sum_duplicates()  # of two values of one entry its slot would keep the last
        values: Real = np.column_stack([entries.data.real, -entries.data.imag, entries.data.imag, entries.data.real])
        row, column = entries.row.astype(np.int64), entries.col.astype(np.int64)
        on, below, above = row == column, row > column, row < column
        D[row[on]] = values[on]
        L[self._entry(row[below], column[below])] = values[below]
        U[self._entry(row[above], column[above])] = values[above]
        return BlockFactors(self.start, self.later, D, L, U)


def _links(Y: sp.csc_array, C: sp.csc_array) -> sp.csc_array:
    """Return which nodes are coupled, by admittances or by a branch, whatever their values; all entries are 1."""
    coupled, incidence = Y.astype(bool), abs(C)
    coupled.data[:] = True  # a stored zero is an entry, and needs its slot
    link = (coupled + coupled.T + incidence @ incidence.T).astype(float).tocsc()
    link.data[:] = 1.0
    return link


def _filled(link: sp.csc_array) -> tuple[Integers, Integers]:
    """Return, for each node, the later ones that its elimination couples: first entries, and nodes, ascending."""
    n = link.shape[0]
    coupled: list[set[int]] = [set() for _ in range(n)]
    start, later = np.zeros(n + 1, np.int64), list[int]()
    for k in range(n):
        own = coupled[k]
        own.update(i for i in link.indices[link.indptr[k] : link.indptr[k + 1]].tolist() if i > k)
        if own:
            parent = min(own)
            coupled[parent] |= own
            coupled[parent].discard(parent)
        later += sorted(own)
        start[k + 1] = start[k] + len(own)
        coupled[k] = set()
    return start, np.array(later, np.int64)


def _ends(C: sp.csc_array) -> tuple[Integers, Integers, Real, Real]:
    """Nodes of each branch and the ratios with which they count; -1 for none."""
    m = C.shape[1]
    nodes, ratios = np.full((2, m), -1, np.int64), np.zeros((2, m))
    branch = np.repeat(np.arange(m), np.diff(C.indptr))
    which = np.arange(C.indices.size) - C.indptr[branch]
    nodes[which, branch], ratios[which, branch] = C.indices, C.data
    return nodes[0], nodes[1], ratios[0], ratios[1]
