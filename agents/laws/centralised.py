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
from gridpeers.wire.plain_sum import plain_sum
from gridpeers.wire.schema.table_schema import SHARED, Range, Unit

_Step = tuple[float, float, float]  # A correction before, the change of its integral, the correction after (pu)


class _Correction:
    """Proportional-integral control of one error (pu)."""

    def __init__(self, k_p: float, k_i: float) -> None:
        self._k_p, self._k_i = k_p, k_i
        self.start(0.0)

    def start(self, correction: float) -> None:
        self._integral, self._error = correction, 0.0

    def step(self, error: float, T: float) -> _Step:
        before, more = self._integral + self._k_p * self._error, self._k_i * T * error
        self._integral += more
        self._error = error
        return before, more, self._integral + self._k_p * error


class Centralised(Law):
    """PI control of frequency and mean voltage at one inverter; all others apply its corrections."""

    source = "Guerrero et al., IEEE Trans. Ind. Electron. 58(1), 2011"

    centre: Annotated[str, "Inverter whose agent is the central controller."] = "inv1"
    k_p: Annotated[float, Range(0, 100), "Proportional gain of frequency."] = 0.2
    k_i: Annotated[float, Unit("1/s"), Range(0, 1e3), "Integral gain of frequency."] = 5.0
    k_pE: Annotated[float, Range(0, 100), "Proportional gain of voltage."] = 0.2
    k_iE: Annotated[float, Unit("1/s"), Range(0, 1e3), "Integral gain of voltage."] = 2.0

    omega: Annotated[float, SHARED, Unit("pu"), "Correction of frequency, from the centre."]
    E: Annotated[float, SHARED, Unit("pu"), "Correction of voltage, from the centre."]
    v: Annotated[float, SHARED, Unit("pu"), "Terminal voltage, from all others."]

    def __init__(self, **parameters: Any) -> None:
        super().__init__(**parameters)
        self._of_omega, self._of_E = _Correction(self.k_p, self.k_i), _Correction(self.k_pE, self.k_iE)

    def start(self, own: Own) -> None:
        self._of_omega.start(own.m_p * own.P_set)
        self._of_E.start(own.V_set - 1.0)

    def step(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> SetPoints:
        if own.name == self.centre:
            of_omega, of_E = self._of_omega.step(-own.e, T), self._of_E.step(self._mean_error(own, neighbours), T)
            P_set, V_set, shared = of_omega[2] / own.m_p, 1.0 + of_E[2], {"omega": of_omega[2], "E": of_E[2]}
            return SetPoints(P_set, V_set, shared, True, partial(_terms_of_centre, own, of_omega, of_E))
        for other in neighbours:
            if other.name == self.centre and {"omega", "E"} <= other.shared.keys():
                P_set, V_set = other.shared["omega"] / own.m_p, 1.0 + other.shared["E"]
                terms = partial(_terms_of_correction, own, P_set, V_set, other.name)
                return SetPoints(P_set, V_set, {"v": own.V}, True, terms)
        return SetPoints(own.P_set, own.V_set, {"v": own.V}, True, Terms)

    def _mean_error(self, own: Own, neighbours: Sequence[Neighbour]) -> float:
        voltages = [own.V, *(other.shared["v"] for other in neighbours if "v" in other.shared)]
        return 1.0 - plain_sum(voltages) / len(voltages)


def _terms_of_correction(own: Own, P_set: float, V_set: float, centre: str) -> Terms:
    name = "correction of the centre"
    return Terms((Term(name, P_set - own.P_set, centre),), (Term(name, V_set - own.V_set, centre),))


def _terms_of_centre(own: Own, of_omega: _Step, of_E: _Step) -> Terms:
    found = []
    for name, (before, more, after), base, beyond in (
        ("frequency error", of_omega, own.m_p, of_omega[0] / own.m_p - own.P_set),
        ("voltage error", of_E, 1.0, 1.0 + of_E[0] - own.V_set),
    ):
        change = Term(f"change of {name}", (after - before - more) / base)
        # The last is 0 but after a limit: the integral goes on beyond it, while the set-point stays.
        found.append((Term(f"integral of {name}", more / base), change, Term("integral beyond the limit", beyond)))
    return Terms(found[0], found[1])
