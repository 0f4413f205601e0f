"""Admittance matrices of single branches, between the nodes of their two ends."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridpeers.plant.equipment import Line, LineConfig, Transformer

DELTA = np.array([[1.0, -1.0, 0.0], [0.0, 1.0, -1.0], [-1.0, 0.0, 1.0]])
"""Voltages across A-B, B-C, C-A from those of A, B, C."""


def line_admittance(line: Line, config: LineConfig, *, charging: bool) -> NDArray[np.complex128]:
    r"""Return the nodal admittance of a line (S), a pi of series impedance and halves of the shunt capacitance.

    .. math:: Y = \begin{pmatrix} z^{-1} + y/2 & -z^{-1} \\ -z^{-1} & z^{-1} + y/2 \end{pmatrix}

    Parameters
    ----------
    line : Line
        Its phases and length.
    config : LineConfig
        Its impedance and susceptance per length.
    charging : bool
        Whether to include the shunt capacitance.

    Returns
    -------
    complex128[2p, 2p]
        Nodes in the order: phases of the from end, phases of the to end.

    References
    ----------
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


def transformer_admittance(transformer: Transformer, V_from: float, V_to: float) -> NDArray[np.complex128]:
    """Return the nodal admittance of a three-phase transformer (S) at its nominal ratio.

    A delta-delta transformer passes no zero sequence, so the mean of the three voltages at `to_bus` is undetermined,
    and the matrix would be singular there. A zero-sequence admittance to ground at `to_bus` sets this mean to zero.
    It carries no current, hence changes nothing, as long as nothing else at `to_bus` is connected to ground; loads
    behind a delta winding must be delta loads.

    Parameters
    ----------
    transformer : Transformer
        Its connection, rating and impedance.
    V_from, V_to : float
        Nominal voltages of its buses (V, line-to-neutral).

    Returns
    -------
    complex128[6, 6]
        Nodes in the order: A, B, C of from_bus, A, B, C of to_bus.

    References
    ----------
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
