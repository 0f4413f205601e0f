"""The circuits of a feeder: for each set of closed switches, the network in the form of the dynamics."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from plant.dynamics import Circuit, PlantError
from plant.dynamics.foreseen_cache import ForeseenCache
from plant.network import Network
from plant.network.loads import LoadBranches


class Circuits:
    """A feeder's circuits; each is made at the first call for its switches and loads, and kept as in `ForeseenCache`.

    Parameters
    ----------
    network
        The feeder's network.
    """

    def __init__(self, network: Network) -> None:
        self._network = network
        self._loads = {network: network.loads()}
        """Load branches of each network of which circuits are kept: one for each state of the loads."""
        self._made: ForeseenCache[tuple[Network, frozenset[str]], Circuit] = ForeseenCache()

    def change_loads(self, network: Network) -> None:
        """Go on with the same network with other loads."""
        self._network = network

    def of(self, closed: frozenset[str], network: Network | None = None, *, foreseen: bool = False) -> Circuit:
        """Return the circuit with these switches closed, with the present loads or with those of another network.

        One that is `foreseen`, for an event to come, stays.

        Raises
        ------
        PlantError
            If ideal devices tie an inverter to another: their sharing would be undetermined.
        """
        of = self._network if network is None else network
        return self._made.get((of, closed), lambda: circuit_of(of, closed, self._loads_of(of)), foreseen=foreseen)

    def _loads_of(self, network: Network) -> LoadBranches:
        """Return the load branches of a network."""
        if network not in self._loads:
            still = {used for used, _ in self._made} | {self._network}
            self._loads = {used: loads for used, loads in self._loads.items() if used in still}
            self._loads[network] = network.loads()
        return self._loads[network]


def circuit_of(network: Network, closed: frozenset[str], loads: LoadBranches) -> Circuit:
    """Make the circuit of a feeder with these switches closed; `loads` are at their own nodes."""
    merge = network.merge(closed)
    on = loads.on(merge)
    n, m = len(network.nodes), len(on)
    branch = np.arange(m)
    delta = on.n_to >= 0
    C = sp.csc_array(
        (
            np.concatenate([on.a_from, -on.a_to[delta]]),
            (np.concatenate([on.n_from, on.n_to[delta]]), np.concatenate([branch, branch[delta]])),
        ),
        shape=(n, m),
    )
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
    return Circuit(
        Y=network.admittance(closed),
        sources=network.source_nodes,
        source_voltage=network.source_voltage,
        terminals=terminals,
        C=C,
        loads=on.law,
        V_branch=on.V_nom * np.exp(1j * on.phi0),
    )
