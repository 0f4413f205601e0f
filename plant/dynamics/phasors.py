"""The balanced set of three phasors, and its part in any three phasors."""

from __future__ import annotations

import numpy as np

from gridpeers.plant.dynamics.kernel.arithmetic import A120
from gridpeers.plant.dynamics.reduction.reduced import Complex

PHASES = np.array([1.0, A120.conjugate(), A120])
"""Balanced set of phasors, phase A at 0."""

_ONTO_A = np.array([1.0, A120, A120**2])
"""Factors that turn the phases of a balanced set onto phase A."""


def aligned_sum(V: Complex) -> Complex:
    """Return the sum of the phasors in the last axis (A, B, C), each turned onto phase A: 3 x positive sequence.

    Examples
    --------
    >>> float(abs(aligned_sum(240.0 * PHASES)).round(9)), float(abs(aligned_sum(240.0 * PHASES[::-1])).round(9))
    (720.0, 0.0)
    """
    return np.asarray(V @ _ONTO_A)
