"""Loads whose current is not proportional to their voltage: constant power and constant current."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from plant.network.merging import Merge


@dataclass(frozen=True, kw_only=True)
class LoadBranches:
    r"""Load branches from a node to ground (wye) or to another node (delta), as parallel arrays.

    With the voltage across the branch :math:`V = a_f V_{n_f} - a_t V_{n_t}` its current is

    .. math:: I = (S / V)^* + I_0 \, V / |V|

    so the constant-current part keeps magnitude and power factor at any angle. `Network.admittance` has the
    constant-impedance loads.

    References
    ----------
    `inverter-models.md` section 6.2 (GridLAB-D's load model).
    """

    n_from: NDArray[np.int64]
    """Node at the beginning."""
    n_to: NDArray[np.int64]
    """Node at the end, -1: ground."""
    S: NDArray[np.complex128]
    """Constant power (VA)."""
    I0: NDArray[np.complex128]
    """Constant current (A) with the voltage's angle taken out: conj(S_I) / V_nom."""
    V_nom: NDArray[np.float64]
    """Nominal voltage across the branch (V)."""
    phi0: NDArray[np.float64]
    """Nominal angle of the voltage across the branch (rad)."""
    a_from: NDArray[np.float64]
    """Ratio of the voltage at the branch's beginning to that of node `n_from`: 1 unless merged."""
    a_to: NDArray[np.float64]
    """The same at its end; 0 at ground, where index -1 would read the last node's voltage."""

    def __len__(self) -> int:
        return len(self.n_from)

    def on(self, merge: Merge) -> LoadBranches:
        """Return the same loads, connected to the representatives of their nodes."""
        return LoadBranches(
            n_from=merge.representative[self.n_from],
            n_to=np.where(self.n_to < 0, -1, merge.representative[self.n_to]),
            S=self.S,
            I0=self.I0,
            V_nom=self.V_nom,
            phi0=self.phi0,
            a_from=self.a_from * merge.ratio[self.n_from],
            a_to=self.a_to * merge.ratio[self.n_to],
        )

    def voltages(self, V: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return the voltages across the branches (V) from the nodes' voltages (V, line-to-ground)."""
        return np.asarray(self.a_from * V[self.n_from] - self.a_to * V[self.n_to], dtype=np.complex128)

    def branch_currents(self, V: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return the currents through the branches (A). A branch without voltage, in a dead island, takes none."""
        across = self.voltages(V)
        magnitude = np.abs(across)
        alive = magnitude > 0.0
        divisor = np.where(alive, across, 1.0)
        current = np.conj(self.S / divisor) + self.I0 * divisor / np.where(alive, magnitude, 1.0)
        return np.asarray(np.where(alive, current, 0.0), dtype=np.complex128)

    def powers(self, V: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return the powers taken by the branches (VA)."""
        return np.asarray(self.voltages(V) * np.conj(self.branch_currents(V)), dtype=np.complex128)

    def currents(self, V: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return the currents that the loads draw from the nodes (A), positive into the load.

        Parameters
        ----------
        V : complex128[n]
            Voltages of all nodes (V, line-to-ground).

        Returns
        -------
        complex128[n]
            In the order of V; those of a delta load sum to zero unless ratios differ.
        """
        current = self.branch_currents(V)
        drawn = np.zeros(len(V), dtype=np.complex128)
        np.add.at(drawn, self.n_from, self.a_from * current)
        np.add.at(drawn, self.n_to, -self.a_to * current)
        return drawn
