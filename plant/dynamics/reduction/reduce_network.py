"""The form in which a switch state is solved: sparse factors, or dense matrices where few branches have a load."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridpeers.plant.dynamics.circuit import Circuit
from gridpeers.plant.dynamics.reduction.reduced import Complex
from gridpeers.plant.dynamics.reduction.reduction import DenseReduction
from gridpeers.plant.dynamics.reduction.sparse_reduction import SparseReduction

Reduction = DenseReduction | SparseReduction

MOST_DENSE = 30
"""Load branches up to which dense matrices are faster: their cost grows with the square of it."""


def reduce_network(circuit: Circuit, y_f: Complex, forming: NDArray[np.bool_], online: NDArray[np.bool_]) -> Reduction:
    """Return a switch state as it is solved; arguments as for `gridpeers.plant.dynamics.switch_state.SwitchState`.

    Never dense with a neutral: where nothing earths it, the impedance of its insulation is in each entry, and what
    matters is in differences too small for their rounding.
    """
    if circuit.two_ended and (circuit.loads.S.size > MOST_DENSE or circuit.neutrals.size):
        return SparseReduction(circuit, y_f, forming, online)
    return DenseReduction(circuit, y_f, forming, online)
