"""Series impedances of lines from conductors and distances: the modified Carson equations and Kron's reduction.

60 Hz, earth of 100 ohm m; ohm per mile, distances in feet.

W. H. Kersting, Distribution System Modeling and Analysis, 3rd ed., equations (4.39), (4.40), (4.55), (4.89) to (4.93).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import log
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

F, EARTH = 60.0, 100.0

Impedance = NDArray[np.complex128]


class Conductor(NamedTuple):
    """One wire."""

    R: float
    """Resistance (ohm per mile)."""
    gmr: float
    """Geometric mean radius (ft)."""


def overhead_impedance(
    between: Sequence[Sequence[float]], to_neutral: Sequence[float], phase: Conductor, neutral: Conductor
) -> Impedance:
    """Return the impedance of a line with one neutral wire.

    Parameters
    ----------
    between
        Distances between the phases (ft), n x n.
    to_neutral
        Distances from the phases to the neutral (ft).
    phase, neutral
        Their wires.
    """
    n = len(to_neutral)
    Z = np.empty((n + 1, n + 1), complex)
    for i in range(n):
        Z[i, i], Z[i, n], Z[n, i] = _own(phase), _mutual(to_neutral[i]), _mutual(to_neutral[i])
        for j in range(n):
            if i != j:
                Z[i, j] = _mutual(between[i][j])
    Z[n, n] = _own(neutral)
    return _reduced(Z, n)


def cable_impedance(
    positions: Sequence[float], phase: Conductor, strand: Conductor, strands: int, radius: float
) -> Impedance:
    """Return the impedance of parallel cables with concentric neutrals.

    Parameters
    ----------
    positions
        Places of the cables along a line (ft).
    phase, strand
        The core and one strand of the neutral.
    strands, radius
        How many strands there are, and on which circle (ft).
    """
    n = len(positions)
    neutral = Conductor(strand.R / strands, (strand.gmr * strands * radius ** (strands - 1)) ** (1.0 / strands))
    Z = np.empty((2 * n, 2 * n), complex)
    for i in range(2 * n):
        for j in range(2 * n):
            a, b = i % n, j % n
            if i == j:
                Z[i, i] = _own(phase if i < n else neutral)
            else:
                Z[i, j] = _mutual(radius if a == b else abs(positions[a] - positions[b]))
    return _reduced(Z, n)


def _own(wire: Conductor) -> complex:
    return wire.R + _mutual(wire.gmr)


def _mutual(distance: float) -> complex:
    return complex(0.00158836 * F, 0.00202237 * F * (log(1.0 / distance) + 7.6786 + log(EARTH / F) / 2.0))


def _reduced(Z: Impedance, n: int) -> Impedance:
    """Return the impedance of the first n wires, with the others at zero voltage."""
    reduced: Impedance = Z[:n, :n] - Z[:n, n:] @ np.linalg.solve(Z[n:, n:], Z[n:, :n])
    return reduced
