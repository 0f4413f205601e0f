r"""The currents that load branches draw, and their tangent.

A branch has a constant power S and a constant current I_0, :math:`I = (S / V)^* + I_0 V / |V|`; or, for loads of
feeders that come from other programs, the law of `gridpeers.plant.equipment.imported_equipment.LoadPart`.

References
----------
`inverter-models.md` section 6.2 (GridLAB-D's load model).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gridpeers.plant.dynamics.kernel.limited_load import COLUMNS, limited_currents, limited_tangents

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class LoadLaw:
    """The law of m load branches, as parallel arrays."""

    S: Complex
    """Constant power of each (VA)."""
    I0: Complex
    """Constant current of each (A) at branch voltage angle 0: I = I0 V / abs(V)."""
    limited_at: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    """Branches with a `LoadPart`'s law; their S and I0 are 0."""
    law: Real = field(default_factory=lambda: np.zeros((0, len(COLUMNS))))
    """Their rows of `gridpeers.plant.dynamics.kernel.limited_load.COLUMNS`."""

    def __add__(self, others: LoadLaw) -> LoadLaw:
        """Return the law of these branches and then of the others."""
        return LoadLaw(
            S=np.concatenate([self.S, others.S]),
            I0=np.concatenate([self.I0, others.I0]),
            limited_at=np.concatenate([self.limited_at, others.limited_at + self.S.size]),
            law=np.concatenate([self.law, others.law]),
        )

    def of(self, branches: NDArray[np.int64]) -> LoadLaw:
        """Return the law of some of the branches."""
        place = np.full(self.S.size, -1, np.int64)
        place[branches] = np.arange(branches.size)
        at = place[self.limited_at]
        return LoadLaw(S=self.S[branches], I0=self.I0[branches], limited_at=at[at >= 0], law=self.law[at >= 0])

    def currents(self, V: Complex) -> Complex:
        """Return the branches' currents (A) at their voltages (V); a branch without voltage takes none."""
        magnitude = np.abs(V)
        alive = magnitude > 0.0
        divisor = np.where(alive, V, 1.0)
        current = np.conj(self.S / divisor) + self.I0 * divisor / np.where(alive, magnitude, 1.0)
        if self.limited_at.size:
            limited_currents(self.limited_at, self.law, np.concatenate([V.real, V.imag]), current)
        return np.asarray(np.where(alive, current, 0.0), dtype=np.complex128)

    def tangent(self, V: Complex) -> tuple[Complex, Complex]:
        """Return the factors (S) by which the currents follow the voltages V (V), and these conjugate."""
        magnitude = np.abs(V)
        A = self.I0 / (2.0 * magnitude)
        B = -np.conj(self.S) / np.conj(V) ** 2 - self.I0 * V / (2.0 * magnitude * np.conj(V))
        if self.limited_at.size:
            limited_tangents(self.limited_at, self.law, V, A, B)
        return A, B
