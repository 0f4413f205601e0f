"""The nodes of a network that matter in a switch state; the others are taken out exactly (Kron reduction)."""

from __future__ import annotations

import heapq
from itertools import combinations
from weakref import WeakKeyDictionary

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from gridpeers.plant.dynamics.circuit import Circuit
from gridpeers.plant.dynamics.kernel.compiled import Complex, Flags, Integers, Real
from gridpeers.plant.dynamics.kernel.network_arrays import BlockFactors, add_tangent

MOST_NEIGHBOURS = 8  # neighbours up to which taking a node out makes the matrix smaller
WEAK = 1e-6
"""Part of a node's largest coupling below which its own admittance is no pivot: what is in series there cancels."""


def eliminated(Y: sp.csr_array, keep: Flags) -> tuple[Integers, sp.csc_array]:
    """Take out nodes that need not be kept, those of fewest neighbours first; return the others and their matrix.

    Weak nodes are kept, too. Terms that cancel leave no entry.
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


def elimination_order(Y: sp.csc_array, C: sp.csc_array) -> Integers:
    """Return the order of the nodes, by minimum degree, in which elimination couples few of the others.

    Those without an own admittance come last: elimination of the others gives them one.
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
    """The matrix of a network as blocks [Re; Im] of its nodes in the order of elimination, with room for its factors.

    `ends`: nodes of each branch, or -1; `ratios`: with which their voltages count in it.
    """

    def __init__(self, Y: sp.csc_array, C: sp.csc_array) -> None:
        self.start, self.later = _filled(_links(Y, C))
        self._Y = self._blocks(Y)
        self.ends, self.ratios = _ends(C)
        pairs = list(combinations(self.ends.T, 2))
        self._across = np.full((self.ends.shape[0], len(pairs)), -1, np.int64)
        for k, (first, second) in enumerate(pairs):
            both = (first >= 0) & (second >= 0)
            self._across[both, k] = self._entry(first[both], second[both])

    def matrix(self, A: Complex, B: Complex, y: Complex | None = None) -> BlockFactors:
        """Return V -> (Y + diag(y)) V + C (A C' V + B C' V^*), to be factored in place."""
        f = self._Y._replace(D=self._Y.D.copy(), L=self._Y.L.copy(), U=self._Y.U.copy())
        if y is not None:
            f.D[:] += np.column_stack([y.real, -y.imag, y.imag, y.real])
        add_tangent(f, self.ends, self.ratios, self._across, A, B)
        return f

    def _entry(self, i: Integers, j: Integers) -> Integers:
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


def _ends(C: sp.csc_array) -> tuple[Integers, Real]:
    """Return the nodes of each branch, -1 for none, and the ratios with which they count."""
    count = np.diff(C.indptr)
    shape = count.size, int(np.max(count, initial=1))
    nodes, ratios = np.full(shape, -1, np.int64), np.zeros(shape)
    branch = np.repeat(np.arange(count.size), count)
    which = np.arange(C.indices.size) - C.indptr[branch]
    nodes[branch, which], ratios[branch, which] = C.indices, C.data
    return nodes, ratios


class KeptNetwork:
    """The unknown nodes with a load, a terminal or a link to a source, without the inverters' filters.

    `place`: position of each node among them, or -1; `Y`, `Y_S`: admittances between them, and to the sources (S); `C`,
    `C_S`: incidence of the branches at them, and at the sources; `..._whole`: of all unknown nodes.
    """

    def __init__(self, circuit: Circuit, unknown: Integers, C: sp.csc_array, to_ground: Real) -> None:
        n = circuit.Y.shape[0]
        Y_whole = circuit.Y + sp.diags_array(to_ground) if to_ground.any() else circuit.Y
        rows, by_node = Y_whole.tocsr()[unknown], C.tocsr()
        self.Y_S_whole, self.C_whole = rows[:, circuit.sources], by_node[unknown]
        needed = (np.diff(self.C_whole.indptr) > 0) | (np.diff(self.Y_S_whole.indptr) > 0)
        place = np.full(n, -1, np.int64)
        place[unknown] = np.arange(unknown.size)
        at = place[circuit.terminals]
        needed[at[at >= 0]] = True
        kept, Y = eliminated(rows[:, unknown], needed)
        order = elimination_order(Y, self.C_whole[kept].tocsc())
        kept = kept[order]
        self.nodes, self.Y = unknown[kept], Y[order][:, order].tocsc()
        self.Y_S, self.C = self.Y_S_whole[kept].tocsc(), self.C_whole[kept].tocsc()
        self.C_S = by_node[circuit.sources].tocsc()
        self.place = np.full(n, -1, np.int64)
        self.place[self.nodes] = np.arange(kept.size)
        self.pattern = BlockPattern(self.Y, self.C)


_made: WeakKeyDictionary[Circuit, dict[tuple[bytes, ...], KeptNetwork]] = WeakKeyDictionary()


def kept_network(
    circuit: Circuit, unknown: Integers, branches: Integers, C: sp.csc_array, to_ground: Real
) -> KeptNetwork:
    """Return the network of these unknown nodes and live branches, which is made once for a circuit."""
    made = _made.setdefault(circuit, {})
    key = unknown.tobytes(), branches.tobytes(), to_ground.tobytes()
    if key not in made:
        made[key] = KeptNetwork(circuit, unknown, C, to_ground)
    return made[key]
