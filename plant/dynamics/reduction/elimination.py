"""Nodes at which nothing happens, taken out of a sparse admittance matrix exactly (Kron reduction)."""

from __future__ import annotations

import heapq

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

MOST_NEIGHBOURS = 8
"""Neighbours up to which taking a node out makes the matrix smaller: it couples all of them with each other."""

WEAK = 1e-6
"""Part of a node's largest coupling below which its own admittance is no pivot: what is in series there cancels."""


def eliminated(Y: sp.csr_array, keep: NDArray[np.bool_]) -> tuple[NDArray[np.int64], sp.csc_array]:
    """Take out nodes that need not be kept, those of fewest neighbours first.

    Parameters
    ----------
    Y
        Admittances (S), symmetric or not.
    keep
        Nodes to keep: those with a load, a terminal or a link to a source. Weak ones are kept, too.

    Returns
    -------
    kept : int64[k]
        The nodes that are left, ascending.
    Y_kept : csc_array, complex, k x k
        What they see of the network, to rounding; terms that cancel leave no entry.
    """
    n = Y.shape[0]
    rows = [
        dict(zip(Y.indices[begin:end].tolist(), Y.data[begin:end].tolist(), strict=True))
        for begin, end in zip(Y.indptr[:-1].tolist(), Y.indptr[1:].tolist(), strict=True)
    ]
    for node, own in enumerate(rows):  # coupling need not be mutual: y_ij may be 0 where y_ji is not
        for neighbour in own:
            rows[neighbour].setdefault(node, 0.0)
    waiting = [(len(rows[node]), node) for node in np.flatnonzero(~keep).tolist()]
    heapq.heapify(waiting)
    gone = np.zeros(n, bool)
    while waiting:
        size, node = heapq.heappop(waiting)
        if len(rows[node]) != size:  # it has other neighbours by now
            heapq.heappush(waiting, (len(rows[node]), node))
            continue
        if size - 1 > MOST_NEIGHBOURS:
            break
        own = rows[node]
        if abs(own.get(node, 0.0)) <= WEAK * max(map(abs, own.values()), default=0.0):
            continue
        pivot = own.pop(node)
        for neighbour in own:
            beside = rows[neighbour]
            factor = beside.pop(node) / pivot
            for other, value in own.items():
                beside[other] = beside.get(other, 0.0) - factor * value
        gone[node] = True
    kept = np.flatnonzero(~gone)
    place = np.full(n, -1, np.int64)
    place[kept] = np.arange(kept.size)
    count = [len(rows[node]) for node in kept.tolist()]
    columns = [other for node in kept.tolist() for other in rows[node]]
    values = [value for node in kept.tolist() for value in rows[node].values()]
    where = (np.repeat(np.arange(kept.size), count), place[np.array(columns, np.int64)])
    reduced = sp.csc_array((np.array(values, complex), where), shape=(kept.size, kept.size))
    reduced.eliminate_zeros()
    return kept, reduced
