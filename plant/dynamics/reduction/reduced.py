"""The arrays of the inner loop, linearised: see `gridpeers.plant.dynamics.reduction.reduction` for the equations."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridpeers.plant.dynamics.kernel.sparse import NO_MAPS, SparseMaps

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

NO_MATRIX, NO_VECTOR = np.zeros((0, 0)), np.zeros(0)
"""In place of the dense matrices of a network that is solved by sparse factors."""


class Reduced(NamedTuple):
    """A network at a tangent of its loads, by dense matrices or by sparse factors.

    Real matrices act on [Re; Im] and are stored transposed, rows contiguous.
    """

    S: Complex
    """Constant power of the live branches (VA)."""
    I0: Complex
    """Constant current of the live branches (A)."""
    limited_at: NDArray[np.int64]
    """Live branches with the law of a `LoadPart`."""
    law: Real
    """Their rows of `gridpeers.plant.dynamics.kernel.limited_load.COLUMNS`."""
    i_c: Complex
    """Tangent of the load law, constant part (A)."""
    A: Complex
    """Tangent, factor of V_b (S)."""
    B: Complex
    """Tangent, factor of V_b^* (S)."""
    branch_island: NDArray[np.int64]
    """Island of each live branch."""
    inverter_island: NDArray[np.int64]
    """Island of each inverter."""
    leader: NDArray[np.int64]
    """For each island the inverter whose angle sets its frame; -1: the frame does not rotate."""
    theta_lin: Real
    """That inverter's angle at the point of linearisation (rad)."""
    PT: Real = NO_MATRIX
    """J to x, (6 n_inv) x (2 m)."""
    QT: Real = NO_MATRIX
    """N to x, (2 m) x (2 m)."""
    x_c: Real = NO_VECTOR
    """Constant part of x, 2 m (V)."""
    GGT: Real = NO_MATRIX
    """J to V_G, (6 n_inv) x (6 n_inv)."""
    GBT: Real = NO_MATRIX
    """I_b to V_G, (2 m) x (6 n_inv)."""
    s_G: Real = NO_VECTOR
    """Constant part of V_G, 6 n_inv (V)."""
    sparse: SparseMaps = NO_MAPS
    """Sparse factors in place of the dense matrices."""
