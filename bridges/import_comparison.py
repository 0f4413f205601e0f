"""Our power flow of an imported feeder beside that of the program that read it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from gridpeers.plant.equipment import Feeder
from gridpeers.plant.equipment.connectivity import Node
from gridpeers.plant.network import Network, solve_power_flow

MATCH = 1e-6
"""Largest difference (pu of nominal voltage) of voltages that count as equal."""

TOLERANCE = 1e-11
"""Largest change of any voltage (pu) in the last iteration of our power flow."""


class Difference(NamedTuple):
    """Our power flow beside another program's."""

    largest: float
    """Largest difference of a voltage (pu)."""
    node: Node
    """The node that has it."""
    two_solutions: bool
    """Whether the other program's voltages solve our equations as well: loads whose law jumps have two solutions."""


def difference(feeder: Feeder, theirs: Mapping[Node, complex]) -> Difference:
    """Return the largest difference between our voltages and another program's, `theirs` (V).

    ArithmeticError if our power flow does not converge.
    """
    network = Network(feeder)
    at = [k for k, node in enumerate(network.nodes) if node in theirs]
    given = np.array([theirs[network.nodes[k]] for k in at])
    # where the given voltage is far above the nominal one, the nominal one is not what the script means
    scale = np.maximum(network.V_nom[at], np.abs(given))

    def solved_from(start: NDArray[np.complex128] | None) -> NDArray[np.float64]:
        V = solve_power_flow(network, network.closed0, tolerance=TOLERANCE, start=start).V
        return np.asarray(np.abs(V[at] - given) / scale)

    off = solved_from(None)
    worst = int(np.argmax(off))
    two = False
    if off[worst] > MATCH:
        start = network.nominal.copy()
        start[at] = given
        try:
            two = bool(solved_from(start).max() <= MATCH)
        except ArithmeticError:
            two = False
    return Difference(float(off[worst]), network.nodes[at[worst]], two)


def loads_without_ground(feeder: Feeder) -> list[str]:
    """Return loads of constant power to ground where the network itself holds next to nothing to ground.

    Behind a delta winding nothing but the load ties its phases to ground. The current of a constant power falls when
    its voltage rises, so that the voltage to ground has several solutions, or none that is stable.
    """
    network = Network(feeder)
    Y = network.admittance(network.closed0)
    used = np.setdiff1d(np.flatnonzero(np.diff(Y.indptr) > 0), network.source_nodes)
    factors = splu(csc_matrix(Y[used][:, used]))
    place = {int(node): k for k, node in enumerate(used)}
    merge = network.merge(network.closed0)
    found: dict[str, None] = {}
    loads: dict[tuple[str, str], list[tuple[int, float]]] = {}
    for part in feeder.load_parts:
        if part.exponents == (0.0, 0.0) and not part.ends[1]:
            node = int(merge.representative[network.index(part.bus, part.ends[0])])
            if node in place:
                loads.setdefault((part.bus, part.name), []).append((place[node], abs(part.S) / part.V_nom**2))
    for (_, name), ends in loads.items():
        right = np.zeros(len(used), complex)
        right[[k for k, _ in ends]] = 1.0
        lifted = factors.solve(right)[[k for k, _ in ends]].sum()
        if len(ends) ** 2 / abs(lifted) < sum(y for _, y in ends):
            found[name] = None
    return list(found)
