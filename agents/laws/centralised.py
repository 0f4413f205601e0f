r"""Centralised secondary control: one controller restores frequency and mean voltage for all. Pure.

J. M. Guerrero, J. C. Vasquez, J. Matas, L. García de Vicuña, M. Castilla, "Hierarchical Control of Droop-Controlled AC
and DC Microgrids - A General Approach Toward Standardization", IEEE Trans. Ind. Electron. 58(1), 2011: the microgrid's
central controller measures the errors, and sends the same corrections to all inverters,

.. math::
    \delta\omega = k_p (\omega^* - \omega) + k_i \int (\omega^* - \omega) dt, \qquad
    \delta E = k_{pE} (E^* - E) + k_{iE} \int (E^* - E) dt .

The controller runs in the agent of one inverter (`centre`), which must have a link from and to every other agent (graph
"full", or a star); E is the mean of the voltages that it receives. In per unit delta omega = m_p P_set and
delta E = V_set - 1. An inverter that does not hear the centre keeps the last corrections.

**Claim of the paper.** Frequency and voltage return to nominal, and droop continues to share real power. Vars are left
to droop, and without the centre nothing is restored.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

from gridpeers.agents.laws.law import Law, Neighbour, Own, SetPoints, Term, Terms
from gridpeers.wire.schema.table_schema import Range, Unit


class Centralised(Law):
    """PI control of frequency and mean voltage at one inverter, whose corrections all others take over."""

    source = "Guerrero et al., IEEE Trans. Ind. Electron. 58(1), 2011"

    centre: Annotated[str, "Inverter whose agent is the central controller."] = "inv1"
    k_p: Annotated[float, Range(0, 100), "Proportional gain of frequency."] = 0.2
    k_i: Annotated[float, Unit("1/s"), Range(0, 1e3), "Integral gain of frequency."] = 5.0
    k_pE: Annotated[float, Range(0, 100), "Proportional gain of voltage."] = 0.2
    k_iE: Annotated[float, Unit("1/s"), Range(0, 1e3), "Integral gain of voltage."] = 2.0

    def __init__(self, **parameters: Any) -> None:
        super().__init__(**parameters)
        self._omega = self._E = 0.0
        """Integrals of the centre (pu)."""
        self._errors = 0.0, 0.0
        """Errors of frequency and voltage at its last step (pu)."""

    def start(self, own: Own) -> None:
        self._omega, self._E = own.m_p * own.P_set, own.V_set - 1.0
        self._errors = 0.0, 0.0

    def step(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> SetPoints:
        if own.name == self.centre:
            error = self._mean_error(own, neighbours)
            self._omega -= self.k_i * T * own.e
            self._E += self.k_iE * T * error
            self._errors = own.e, error
            omega, E = self._omega - self.k_p * own.e, self._E + self.k_pE * error
            return SetPoints(omega / own.m_p, 1.0 + E, {"omega": omega, "E": E})
        for other in neighbours:
            if other.name == self.centre and "omega" in other.shared:
                return SetPoints(other.shared["omega"] / own.m_p, 1.0 + other.shared["E"], {"V": own.V})
        return SetPoints(own.P_set, own.V_set, {"V": own.V})

    def terms(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> Terms:
        if own.name == self.centre:
            error, (e_before, error_before) = self._mean_error(own, neighbours), self._errors
            # Both are 0 but after a limit: the integrals go on beyond it, while the set-points stay.
            P_beyond = (self._omega - self.k_p * e_before) / own.m_p - own.P_set
            V_beyond = 1.0 + self._E + self.k_pE * error_before - own.V_set
            return Terms(
                (
                    Term("integral of frequency error", -self.k_i * T * own.e / own.m_p),
                    Term("change of frequency error", -self.k_p * (own.e - e_before) / own.m_p),
                    Term("integral beyond the limit", P_beyond),
                ),
                (
                    Term("integral of voltage error", self.k_iE * T * error),
                    Term("change of voltage error", self.k_pE * (error - error_before)),
                    Term("integral beyond the limit", V_beyond),
                ),
            )
        for other in neighbours:
            if other.name == self.centre and "omega" in other.shared:
                P, V = other.shared["omega"] / own.m_p, 1.0 + other.shared["E"]
                return Terms(
                    (Term("correction of the centre", P - own.P_set, other.name),),
                    (Term("correction of the centre", V - own.V_set, other.name),),
                )
        return Terms()

    def _mean_error(self, own: Own, neighbours: Sequence[Neighbour]) -> float:
        """Return the error of the mean of the voltages that the centre knows (pu)."""
        voltages = [own.V, *(other.shared["V"] for other in neighbours if "V" in other.shared)]
        return 1.0 - sum(voltages) / len(voltages)
