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
from functools import partial
from typing import Annotated, Any

from gridpeers.agents.laws.law import Law, Neighbour, Own, SetPoints, Term, Terms
from gridpeers.wire.schema.table_schema import SHARED, Range, Unit


class Centralised(Law):
    """PI control of frequency and mean voltage at one inverter, whose corrections all others take over."""

    source = "Guerrero et al., IEEE Trans. Ind. Electron. 58(1), 2011"

    centre: Annotated[str, "Inverter whose agent is the central controller."] = "inv1"
    k_p: Annotated[float, Range(0, 100), "Proportional gain of frequency."] = 0.2
    k_i: Annotated[float, Unit("1/s"), Range(0, 1e3), "Integral gain of frequency."] = 5.0
    k_pE: Annotated[float, Range(0, 100), "Proportional gain of voltage."] = 0.2
    k_iE: Annotated[float, Unit("1/s"), Range(0, 1e3), "Integral gain of voltage."] = 2.0

    omega: Annotated[float, SHARED, Unit("pu"), "Correction of frequency, of the centre."]
    E: Annotated[float, SHARED, Unit("pu"), "Correction of voltage, of the centre."]

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
            return self._centre_step(own, self._mean_error(own, neighbours), T)
        for other in neighbours:
            if other.name == self.centre and "omega" in other.shared:
                P_set, V_set = other.shared["omega"] / own.m_p, 1.0 + other.shared["E"]
                terms = partial(_terms_of_correction, own, P_set, V_set, other.name)
                return SetPoints(P_set, V_set, {"V": own.V}, True, terms)
        return SetPoints(own.P_set, own.V_set, {"V": own.V}, True, Terms)

    def _centre_step(self, own: Own, V_error: float, T: float) -> SetPoints:
        f_before, V_before = self._errors
        omega_before, E_before = self._omega - self.k_p * f_before, self._E + self.k_pE * V_before
        more_omega, more_E = -self.k_i * T * own.e, self.k_iE * T * V_error
        self._omega += more_omega
        self._E += more_E
        self._errors = own.e, V_error
        omega, E = self._omega - self.k_p * own.e, self._E + self.k_pE * V_error
        terms = partial(_terms_of_centre, own, (omega_before, more_omega, omega), (E_before, more_E, E))
        return SetPoints(omega / own.m_p, 1.0 + E, {"omega": omega, "E": E}, True, terms)

    def _mean_error(self, own: Own, neighbours: Sequence[Neighbour]) -> float:
        """Return the error of the mean of the voltages that the centre knows (pu)."""
        voltages = [own.V, *(other.shared["V"] for other in neighbours if "V" in other.shared)]
        return 1.0 - sum(voltages) / len(voltages)


def _terms_of_correction(own: Own, P_set: float, V_set: float, centre: str) -> Terms:
    name = "correction of the centre"
    return Terms((Term(name, P_set - own.P_set, centre),), (Term(name, V_set - own.V_set, centre),))


def _terms_of_centre(own: Own, of_omega: tuple[float, float, float], of_E: tuple[float, float, float]) -> Terms:
    """Return the terms of a step from each correction before, the change of its integral, and the correction after."""
    (omega_before, more_omega, omega), (E_before, more_E, E) = of_omega, of_E
    beyond = "integral beyond the limit"  # 0 but after a limit: the integrals go on, while the set-points stay
    return Terms(
        (
            Term("integral of frequency error", more_omega / own.m_p),
            Term("change of frequency error", (omega - omega_before - more_omega) / own.m_p),
            Term(beyond, omega_before / own.m_p - own.P_set),
        ),
        (
            Term("integral of voltage error", more_E),
            Term("change of voltage error", E - E_before - more_E),
            Term(beyond, 1.0 + E_before - own.V_set),
        ),
    )
