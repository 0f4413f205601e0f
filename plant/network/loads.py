"""Loads whose current is not proportional to their voltage: constant power and constant current."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from gridpeers.plant.dynamics.circuit import LoadLaw
from gridpeers.plant.dynamics.kernel.compiled import Complex, Integers, Real
from gridpeers.plant.equipment.imported_equipment import LoadPart
from gridpeers.plant.network.merging import Merge


def law_row(part: LoadPart) -> tuple[float, ...]:
    limits = (V * part.V_nom for V in (part.V_low, part.V_min, part.V_max))
    off = part.V_off * part.V_nom, part.V_off_above * part.V_nom
    return (part.S.real, part.S.imag, part.V_nom, *part.exponents, *limits, part.edge, *off)


@dataclass(frozen=True, kw_only=True)
class LoadBranches:
    """Load branches from a node to ground (wye) or to another node (delta), as parallel arrays.

    The voltage across a branch is V = a_f V[n_f] - a_t V[n_t]. Impedance loads are not here, but in
    `Network.admittance`.
    """

    n_from: Integers  # node at the beginning
    n_to: Integers  # node at the end, -1: ground
    law: LoadLaw  # law of their currents
    V_nom: Real  # nominal voltage across the branch (V)
    phi0: Real  # nominal angle of the voltage across the branch (rad)
    a_from: Real  # voltage at the beginning over that of node `n_from`: 1 unless merged
    a_to: Real  # the same at its end; 0 at ground, where index -1 would read the last node's voltage

    def __len__(self) -> int:
        return len(self.n_from)

    def __add__(self, others: LoadBranches) -> LoadBranches:
        pairs = {name: (getattr(self, name), getattr(others, name)) for name in self.__dataclass_fields__}
        laws = pairs.pop("law")
        return LoadBranches(law=laws[0] + laws[1], **{name: np.concatenate(pair) for name, pair in pairs.items()})

    def on(self, merge: Merge) -> LoadBranches:
        """Return the same loads, connected to the representatives of their nodes."""
        return LoadBranches(
            n_from=merge.representative[self.n_from],
            n_to=np.where(self.n_to < 0, -1, merge.representative[self.n_to]),
            law=self.law,
            V_nom=self.V_nom,
            phi0=self.phi0,
            a_from=self.a_from * merge.ratio[self.n_from],
            a_to=self.a_to * merge.ratio[self.n_to],
        )

    def incidence(self, n: int) -> sp.csc_array:
        """Return C of n nodes: branch voltages are C^T V, and branch currents I draw C I out of the nodes."""
        m = len(self)
        branch, between = np.arange(m), self.n_to >= 0
        values = np.concatenate([self.a_from, -self.a_to[between]])
        where = np.concatenate([self.n_from, self.n_to[between]]), np.concatenate([branch, branch[between]])
        return sp.csc_array((values, where), shape=(n, m))

    def admittance(self, n: int, y: Complex | Real) -> sp.csc_array:
        """Return the matrix (S) between n nodes of branches with these admittances (S)."""
        C = self.incidence(n)
        return sp.csc_array(C @ sp.diags_array(y) @ C.T)

    def voltages(self, V: Complex) -> Complex:
        return np.asarray(self.a_from * V[self.n_from] - self.a_to * V[self.n_to], dtype=np.complex128)

    def branch_currents(self, V: Complex) -> Complex:
        return self.law.currents(self.voltages(V))

    def powers(self, V: Complex) -> Complex:
        return np.asarray(self.voltages(V) * np.conj(self.branch_currents(V)), dtype=np.complex128)

    def currents(self, V: Complex) -> Complex:
        """Return the currents that the loads draw from the nodes (A)."""
        current = self.branch_currents(V)
        drawn = np.zeros(len(V), dtype=np.complex128)
        np.add.at(drawn, self.n_from, self.a_from * current)
        np.add.at(drawn, self.n_to, -self.a_to * current)
        return drawn
