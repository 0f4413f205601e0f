"""The network between the inverters, solved exactly: Newton's method at the nodes that carry a load or an inverter.

It uses the admittances of `plant.network` (beside OpenDSS in part (a)) and none of `plant.dynamics`' reductions.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lu_factor, lu_solve

from plant.dynamics import Circuit

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

EXACT = 1e-12
"""Largest change of a voltage in the last iteration (pu of the largest)."""


class NetworkEquations:
    """The part of a circuit with voltage; all other nodes are 0.

    Parameters
    ----------
    circuit
        The network; its loads are constant power and constant current.
    y_f
        Filter admittances (S) of the terminals in `formed`.
    formed
        Terminals (n x 3 nodes) behind internal voltages.
    fed
        Terminals that currents are injected into.
    """

    def __init__(self, circuit: Circuit, y_f: Complex, formed: NDArray[np.int64], fed: NDArray[np.int64]) -> None:
        assert not circuit.loads.limited_at.size
        _, label = circuit.components()
        live = np.isin(label, label[np.concatenate([circuit.sources, formed.ravel()])])
        free = live.copy()
        free[circuit.sources] = False
        carried = np.zeros(live.size, bool)
        carried[circuit.C.tocoo().row] = carried[formed] = carried[fed] = True
        K, E = np.flatnonzero(free & carried), np.flatnonzero(free & ~carried)
        Y = circuit.Y.toarray()
        empty = np.abs(Y[E]).sum(axis=1) == 0.0  # nodes that are merged into others
        E = E[~empty]
        through = np.linalg.solve(Y[np.ix_(E, E)], np.hstack([Y[np.ix_(E, K)], Y[np.ix_(E, circuit.sources)]]))
        reduced = np.hstack([Y[np.ix_(K, K)], Y[np.ix_(K, circuit.sources)]]) - Y[np.ix_(K, E)] @ through
        place = np.full(live.size, -1, np.int64)
        place[K] = np.arange(K.size)
        C = circuit.C.toarray()
        self.branches = np.flatnonzero(live[np.abs(C).argmax(axis=0)])
        self._C, self._loads = C[np.ix_(K, self.branches)], circuit.loads.of(self.branches)
        self._at_branches = C[np.ix_(circuit.sources, self.branches)].T @ circuit.source_voltage
        self.formed, self.fed, self._y_f = place[formed], place[fed], y_f
        self._Y, self._drawn = reduced[:, : K.size], reduced[:, K.size :] @ circuit.source_voltage
        self._Y[self.formed, self.formed] += y_f[:, None]
        self.nodes = K
        """Nodes whose voltages are the unknowns."""
        self.rotates = not circuit.sources.size
        self._factors: tuple[Real, NDArray[np.int32]] | None = None

    @property
    def factorised(self) -> bool:
        """Whether there is a tangent."""
        return self._factors is not None

    def branch_voltages(self, V: Complex) -> Complex:
        """Return the voltages (V) of `branches` from those of the nodes."""
        voltages: Complex = self._C.T @ V + self._at_branches
        return voltages

    def residual(self, V: Complex, E: Complex, currents: Complex) -> Complex:
        """Return the sum of the currents (A) that leave each node."""
        sum_of: Complex = self._Y @ V + self._drawn + self._C @ self._loads.currents(self.branch_voltages(V))
        sum_of[self.formed] -= self._y_f[:, None] * E
        sum_of[self.fed] -= currents
        return sum_of

    def factorise(self, V: Complex, by_voltage: Complex, weights: Complex) -> None:
        """Take the tangent at these voltages; the currents fed change by `by_voltage` Re(sum of weights V)."""
        A, B = self._loads.tangent(self.branch_voltages(V))
        linear, conjugate = self._Y + (self._C * A) @ self._C.T, (self._C * B) @ self._C.T
        J = np.block(
            [
                [(linear + conjugate).real, (conjugate - linear).imag],
                [(linear + conjugate).imag, (linear - conjugate).real],
            ]
        )
        n = V.size
        for at, change, weight in zip(self.fed, by_voltage, weights, strict=True):
            both, row = np.concatenate([at, at + n]), np.concatenate([weight.real, -weight.imag])
            J[np.ix_(both, both)] -= np.outer(np.concatenate([change.real, change.imag]), row)
        self._factors = lu_factor(J)

    def step(self, residual: Complex) -> Complex:
        """Return the Newton step (V) of a residual (A)."""
        assert self._factors is not None
        d = lu_solve(self._factors, -np.concatenate([residual.real, residual.imag]))
        n = residual.size
        step: Complex = d[:n] + 1j * d[n:]
        return step
