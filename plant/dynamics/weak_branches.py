"""Load branches of which each alone asks for more than the network can carry to it."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from gridpeers.plant.dynamics.load_law import LoadLaw


def weak_branches(Y: sp.csc_array, C: sp.csc_array, loads: LoadLaw, V_nom: NDArray[np.float64]) -> dict[int, float]:
    r"""Return branches of constant power that are too much even alone, and the short-circuit powers there (VA).

    A power S behind an impedance Z has a solution where :math:`V^2 \geq 2 (|Z S| + Re(Z S^*))`. It is the one to which
    a network comes from no load where also the impedance of the load, V^2 / S, is the greater one.

    Parameters
    ----------
    Y
        Admittances between the nodes of unknown voltage (S), regular.
    C
        Incidence of the branches at these nodes.
    loads
        Their law.
    V_nom
        Their nominal voltages (V).
    """
    S, rows = loads.S.astype(complex), loads.law
    S[loads.limited_at] = np.where((rows[:, 3] == 0.0) & (rows[:, 4] == 0.0), rows[:, 0] + 1j * rows[:, 1], 0.0)
    at = np.flatnonzero((S != 0.0) & (np.diff(C.indptr) > 0))
    try:
        factors = splu(sp.csc_matrix(Y))
    except RuntimeError:  # singular: nothing can be said
        return {}
    weak = {}
    for branch in at.tolist():
        ends = C[:, [branch]].toarray().ravel()
        Z = complex(ends @ factors.solve(ends.astype(complex)))
        size, V_square = abs(Z * S[branch]), V_nom[branch] ** 2
        if not V_square >= max(size, 2.0 * (size + (Z * S[branch].conjugate()).real)):
            weak[branch] = V_square / abs(Z)
    return weak
