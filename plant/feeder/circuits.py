"""The circuits of a feeder: for each set of closed switches, the network in the form of the dynamics."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import scipy.sparse as sp

from gridpeers.plant.dynamics import Circuit, PlantError
from gridpeers.plant.dynamics.kernel.compiled import Integers
from gridpeers.plant.dynamics.live_network import KEPT
from gridpeers.plant.equipment import PHASES
from gridpeers.plant.network import Network
from gridpeers.plant.network.loads import LoadBranches
from gridpeers.plant.network.merging import Merge

ROUNDING = 1e-14  # size of a sum of admittances relative to its terms below which the sum is 0 but for rounding


class Circuits:
    """A feeder's circuits, each made at the first call for its switches and loads, and kept for a while."""

    def __init__(self, network: Network) -> None:
        self._network = network
        loads = lru_cache(KEPT)(Network.loads)  # of each network, one for each state of the loads
        self._made = lru_cache(KEPT)(lambda of, closed: circuit_of(of, closed, loads(of)))

    def change_loads(self, network: Network) -> None:
        self._network = network

    def of(self, closed: frozenset[str], network: Network | None = None) -> Circuit:
        """Return the circuit with these switches closed, with the present loads or with those of another network.

        PlantError if ideal devices tie an inverter to another: their sharing would be undetermined.
        """
        return self._made(network or self._network, closed)


def circuit_of(network: Network, closed: frozenset[str], loads: LoadBranches) -> Circuit:
    merge = network.merge(closed)
    on = loads.on(merge)
    raw = np.array(
        [[network.index(unit.bus, phase) for phase in (3 * unit.phases)[:3]] for unit in network.inverters], np.int64
    )
    raw = raw.reshape(-1, 3)
    terminals = merge.representative[raw]
    owner: dict[int, str] = {}
    for unit, nodes, at in zip(network.inverters, terminals, raw, strict=True):
        others = [owner[node] for node in nodes.tolist() if node in owner]
        if others or not np.allclose(merge.ratio[at], 1.0):
            raise PlantError(
                f"{unit.name} at bus {unit.bus} is tied to {others[0] if others else 'another source'} by closed "
                "switches or a regulator, without any impedance between them: move it behind a line"
            )
        owner.update(dict.fromkeys(nodes.tolist(), unit.name))
    Y, C, reference = network.admittance(closed), on.incidence(len(network.nodes)), None
    if any(unit.neutral for unit in network.inverters):
        reference = _references(network, merge, on, terminals)
        Y, C = _referred(Y, C, reference)
    return Circuit(
        Y=Y,
        sources=network.source_nodes,
        source_voltage=network.source_voltage,
        terminals=terminals,
        C=C,
        loads=on.law,
        V_branch=on.V_nom * np.exp(1j * on.phi0),
        reference=reference,
        neutrals=_neutral_nodes(network, merge, reference),
    )


def _neutral_nodes(network: Network, merge: Merge, reference: Integers | None) -> Integers:
    """Return the nodes of neutral conductors whose voltages count from earth, each once."""
    raw = [k for k, (bus, at) in enumerate(network.nodes) if at not in PHASES or at == network.neutrals.get(bus)]
    nodes = np.unique(merge.representative[np.array(raw, np.int64)])
    return nodes if reference is None else nodes[reference[nodes] < 0]


def _references(network: Network, merge: Merge, on: LoadBranches, terminals: Integers) -> Integers:
    """Return the node from which each node's voltage counts: the neutral of an inverter there, or -1.

    A node that a load connects with a terminal counts from the same neutral, where it can: the load is then between two
    nodes in these voltages, too, and not three.
    """
    reference = np.full(len(network.nodes), -1, np.int64)
    for unit, nodes in zip(network.inverters, terminals, strict=True):
        if unit.neutral:
            reference[nodes] = merge.representative[network.index(unit.bus, unit.neutral)]
    fixed = np.zeros(reference.size, bool)
    fixed[network.source_nodes] = fixed[reference[reference >= 0]] = fixed[terminals.ravel()] = True
    for unit, nodes in zip(network.inverters, terminals, strict=True):
        if unit.neutral and (np.isin(nodes, network.source_nodes) | (reference[reference[nodes]] >= 0)).any():
            raise PlantError(
                f"{unit.name} at bus {unit.bus} cannot return to node {unit.neutral}: the substation, or another "
                'inverter, holds one of its nodes without any impedance between; give it neutral "earth"'
            )
    between = on.n_to >= 0
    pairs = np.column_stack([on.n_from[between], on.n_to[between]])
    while True:
        one, other = np.vstack([pairs, pairs[:, ::-1]]).T
        follows = (reference[one] >= 0) & (reference[other] < 0) & ~fixed[other]
        if not follows.any():
            return reference
        reference[other[follows]] = reference[one[follows]]


def _referred(Y: sp.csc_array, C: sp.csc_array, reference: Integers) -> tuple[sp.csc_array, sp.csc_array]:
    n = reference.size
    at = np.flatnonzero(reference >= 0)
    M = sp.csc_array((np.ones(n + at.size), (np.r_[:n, at], np.r_[:n, reference[at]])), shape=(n, n))
    C = sp.csc_array(M.T @ C)
    C.eliminate_zeros()
    entries, sizes = sp.coo_array(M.T @ Y @ M), sp.csr_array(M.T @ abs(Y) @ M)
    size = np.asarray(sizes[entries.row, entries.col]).ravel()
    left = abs(entries.data) > ROUNDING * size
    # what cancels is no coupling; it goes from both places of the matrix, or from none
    kept = sp.csr_array((left.astype(float), (entries.row, entries.col)), shape=(n, n))
    kept = kept + kept.T
    left = np.asarray(kept[entries.row, entries.col]).ravel() > 0.0
    where = entries.row[left], entries.col[left]
    return sp.csc_array((entries.data[left], where), shape=(n, n)), C
