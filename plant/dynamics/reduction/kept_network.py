"""The nodes of a network that matter in a switch state, and what couples them, in the order of elimination."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from gridpeers.plant.dynamics.circuit import Circuit
from gridpeers.plant.dynamics.reduction.block_pattern import BlockPattern, elimination_order
from gridpeers.plant.dynamics.reduction.elimination import eliminated
from gridpeers.plant.dynamics.reduction.reduced import Real


class KeptNetwork:
    """The unknown nodes with a load, a terminal or a link to a source; the others are eliminated, exactly.

    The filters of inverters are not in it, so it serves whatever of the inverters is connected.

    Parameters
    ----------
    circuit
        The network.
    unknown
        Nodes whose voltage is unknown.
    C
        Incidence of the live branches.
    to_ground
        Admittance added at each node (S).

    Attributes
    ----------
    nodes : int64[k]
        The kept nodes.
    place : int64[n]
        Position of each node among them, or -1.
    Y : csc_array, complex, k x k
        Admittances between them (S).
    Y_S, Y_S_whole : sparse, complex, k x s and u x s
        Admittances between them, or all unknown nodes, and the sources (S).
    C, C_whole, C_S : sparse
        Incidence of the branches at them, at all unknown nodes, and at the sources.
    pattern : BlockPattern
        Where the factors have entries.
    """

    def __init__(self, circuit: Circuit, unknown: NDArray[np.int64], C: sp.csc_array, to_ground: Real) -> None:
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
    circuit: Circuit, unknown: NDArray[np.int64], branches: NDArray[np.int64], C: sp.csc_array, to_ground: Real
) -> KeptNetwork:
    """Return the network of these unknown nodes and live branches, which is made once for a circuit."""
    made = _made.setdefault(circuit, {})
    key = unknown.tobytes(), branches.tobytes(), to_ground.tobytes()
    if key not in made:
        made[key] = KeptNetwork(circuit, unknown, C, to_ground)
    return made[key]
