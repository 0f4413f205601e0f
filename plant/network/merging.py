"""Branches between nodes: admittances of lines and transformers, and ideal devices, which merge nodes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from gridpeers.plant.dynamics.kernel.compiled import Complex, Integers, Real
from gridpeers.plant.equipment import Line, LineConfig, Transformer

DELTA = np.array([[1.0, -1.0, 0.0], [0.0, 1.0, -1.0], [-1.0, 0.0, 1.0]])
"""Voltages across A-B, B-C, C-A from those of A, B, C."""


def line_admittance(line: Line, config: LineConfig, *, charging: bool) -> Complex:
    """Return the nodal admittance of a line (S): a pi of series impedance and halves of the shunt capacitance.

    Nodes: phases of the from end, then of the to end. Kersting, Distribution System Modeling and Analysis, section 6.1.
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
    """Return the nodal admittance of a transformer (S) at its nominal ratio; A, B, C of from_bus, then of to_bus.

    Delta-delta passes no zero sequence, so the mean of the voltages at `to_bus` is undetermined. An admittance to
    ground sets it to zero; it carries no current as long as nothing else there has ground. Kersting, chapter 8.
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


class Merge(NamedTuple):
    """Nodes merged by closed switches and regulators, which have no impedance.

    Each group keeps one unknown, the voltage of its representative r: V_i = a_i V_r, and I_r = sum of a_i I_i, because
    ideal devices take no power.
    """

    representative: Integers  # r of each node
    ratio: Real  # a_i of each node: 1 through switches, the tap's through regulators

    def expand(self, V: Complex) -> Complex:
        return np.asarray(self.ratio * V[self.representative], dtype=np.complex128)

    def gather(self, current: Complex) -> Complex:
        gathered = np.zeros(len(current), dtype=np.complex128)
        np.add.at(gathered, self.representative, self.ratio * current)
        return gathered

    def matrix(self) -> sp.csc_array:
        """Return T with V = T V_rep and I_rep = T' I; columns of nodes that represent nothing are empty."""
        n = len(self.representative)
        return sp.csc_array((self.ratio, (np.arange(n), self.representative)), shape=(n, n))


def merge_nodes(names: Sequence[str], ties: Iterable[tuple[int, int, float]], preferred: Sequence[int]) -> Merge:
    """Group nodes tied by devices (from, to, V_to / V_from), represented by a `preferred` node, else the first.

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
