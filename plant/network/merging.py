"""Branches between nodes: admittances of lines and transformers, and ideal devices, which merge nodes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import scipy.sparse as sp

from gridpeers.plant.dynamics.kernel.compiled import Complex, Integers, Real
from gridpeers.plant.equipment import Line, LineConfig, Transformer

DELTA = np.array([[1.0, -1.0, 0.0], [0.0, 1.0, -1.0], [-1.0, 0.0, 1.0]])
"""Voltages across A-B, B-C, C-A from those of A, B, C."""


def line_admittance(line: Line, config: LineConfig, *, charging: bool) -> Complex:
    r"""Return the nodal admittance of a line (S), a pi of series impedance and halves of the shunt capacitance.

    .. math:: Y = \begin{pmatrix} z^{-1} + y/2 & -z^{-1} \\ -z^{-1} & z^{-1} + y/2 \end{pmatrix}

    Nodes in the order: phases of the from end, phases of the to end.

    Kersting, Distribution System Modeling and Analysis, section 6.1 (exact line segment model).
    """
    keep = [config.phases.index(phase) for phase in line.phases]
    p = len(keep)
    z = np.array([[config.Z[i][j] for j in keep] for i in keep], dtype=np.complex128) * line.length
    y = np.linalg.inv(z)
    end = y + 0.5j * np.array([[config.B[i][j] for j in keep] for i in keep]) * line.length if charging else y
    Y = np.empty((2 * p, 2 * p), dtype=np.complex128)
    Y[:p, :p] = Y[p:, p:] = end
    Y[:p, p:] = Y[p:, :p] = -y
    return Y


def transformer_admittance(transformer: Transformer, V_from: float, V_to: float) -> Complex:
    """Return the nodal admittance of a three-phase transformer (S) at its nominal ratio.

    A delta-delta transformer passes no zero sequence, so the mean of the three voltages at `to_bus` is undetermined,
    and the matrix would be singular there. A zero-sequence admittance to ground at `to_bus` sets this mean to zero.
    It carries no current, hence changes nothing, as long as nothing else at `to_bus` is connected to ground; loads
    behind a delta winding must be delta loads.

    Nodes in the order: A, B, C of from_bus, A, B, C of to_bus.

    Kersting, Distribution System Modeling and Analysis, chapter 8.
    """
    y = transformer.S_rated / (3.0 * V_from**2 * transformer.z)
    ratio = V_to / V_from
    if transformer.connection == "D-D":
        phase = y / 3.0 * (DELTA.T @ DELTA)
        reference = y / 3.0 * np.ones((3, 3))
    else:
        phase = y * np.eye(3)
        reference = 0.0 * phase
    return np.block([[phase, -phase / ratio], [-phase / ratio, (phase + reference) / ratio**2]])


class Merge:
    r"""Nodes merged by ideal devices, with their ratios.

    A closed switch or a regulator has no impedance, so it has no admittance either. Instead, each group of nodes
    tied by such devices keeps one unknown, the voltage of its representative r:

    .. math:: V_i = a_i V_{r(i)}, \qquad I_r = \sum_{i \in r} a_i I_i

    with :math:`a_i = 1` through switches and the tap ratio through regulators. The second equation follows from the
    first, because ideal devices take no power.

    `representative`: node -> its representative. A representative represents itself; `ratio`: :math:`a_i`; exactly
    1 for representatives.
    """

    def __init__(self, representative: Integers, ratio: Real) -> None:
        self.representative = representative
        self.ratio = ratio

    @property
    def representatives(self) -> Integers:
        return np.flatnonzero(self.representative == np.arange(len(self.representative))).astype(np.int64)

    def expand(self, V: Complex) -> Complex:
        """Return every node's voltage (V) from the voltages at the representatives (the other entries are unused)."""
        return np.asarray(self.ratio * V[self.representative], dtype=np.complex128)

    def gather(self, current: Complex) -> Complex:
        """Sum the currents of all nodes (A) at the representatives; the other entries become zero."""
        gathered = np.zeros(len(current), dtype=np.complex128)
        np.add.at(gathered, self.representative, self.ratio * current)
        return gathered

    def matrix(self) -> sp.csc_array:
        """Return T with V = T V_rep and I_rep = T' I (n x n; columns of nodes that represent nothing are empty)."""
        n = len(self.representative)
        return sp.csc_array((self.ratio, (np.arange(n), self.representative)), shape=(n, n))


def merge_nodes(names: Sequence[str], ties: Iterable[tuple[int, int, float]], preferred: Sequence[int]) -> Merge:
    """Group nodes that are tied together.

    `names`: names of the nodes, for errors; `ties`: ideal devices: V_to = ratio * V_from; `preferred`: nodes that
    represent their groups by preference, the most preferred first; else the first node does.

    ValueError if two paths between the same nodes have different ratios: an ideal short circuit.
    """
    n = len(names)
    neighbours: list[list[tuple[int, float]]] = [[] for _ in range(n)]
    for node_from, node_to, ratio in ties:
        neighbours[node_from].append((node_to, ratio))
        neighbours[node_to].append((node_from, 1.0 / ratio))
    representative = np.full(n, -1, dtype=np.int64)
    ratios = np.ones(n)
    for start in (*preferred, *range(n)):
        if representative[start] >= 0:
            continue
        representative[start] = start
        waiting = [start]
        while waiting:
            node = waiting.pop()
            for other, step in neighbours[node]:
                ratio = ratios[node] * step
                if representative[other] < 0:
                    representative[other], ratios[other] = start, ratio
                    waiting.append(other)
                elif abs(ratios[other] - ratio) > 1e-12 * ratio:
                    raise ValueError(
                        f"{names[node]} and {names[other]} are tied twice, at {ratios[other] / ratios[node]:.5f} "
                        f"and at {step:.5f} of the voltage: a short circuit through a regulator; "
                        f"open the switch across it, or set its tap to 0"
                    )
    return Merge(representative, ratios)
