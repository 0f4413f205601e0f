r"""The secondary law, equations (12)-(15), for one inverter and one control period.

Everything is per unit of the inverter's own rating, frequency per unit of nominal: p = P/s, q = Q/s, v = V/V_nom,
e = (f - f_nom)/f_nom. With y = m_p P_set (P_set in pu), z = m_q q and kappa = m_p/k_p (1/s), the paper's laws read

.. math::
    \dot y_i &= -\kappa_i \Big[ g_i e_i + \sum_j c_{ij} (y_i - y_j) \Big] \qquad (12), (13) \\
    \dot V_{set,i} &= -\frac{1}{k_q} \Big[ g_i \alpha (v_i - 1) + \beta \sum_j c_{ij} (z_i - z_j) \Big]
        \qquad (14), (15)

with g_i = 1 for a leader (GFM) and 0 for a follower (GFL).

**Units.** The paper's clash: (13) adds w - w_nom to m_p P_set, the index (9) has P in kW over s, while (3), (7), (12)
have no s. Here P is always pu of own rating and w pu of nominal, so m_p is 0.01 for 1 % droop, every term of (12), (13)
is a pu frequency and k_p is in seconds. Hz or rad/s enter nowhere.

**Discretisation.** All terms come from the same old values and are added; d is the sum of c_ij, and a bar the
neighbours' mean with weights c_ij. To first order in T this is (12)-(15). docs/laws.md derives it, with its equilibria
and its stability.

.. math::
    y &\leftarrow y + \tfrac12 (1 - e^{-2 \kappa d T}) (\bar y - y) - g (1 - e^{-\kappa T}) e \\
    V_{set} &\leftarrow V_{set} - F \big[ \beta d (z - \bar z) + g \alpha (v - 1) \big], \quad
        F = (1 - e^{-\lambda T/k_q}) / \lambda, \quad \lambda = \max(g \alpha, 2 \beta d)

**Limits.** P_set and V_set are clamped (anti-windup). The paper has no limits and accepts wind-up (its Remark 2).
`gridpeers.agents.degraded_communication` has these and other options, and other weights c_ij than 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, inf
from typing import Annotated, Any

from gridpeers.agents.agent_config import Gains
from gridpeers.agents.laws.law import Law, Neighbour, Own, SetPoints, Term, Terms
from gridpeers.wire.schema.table_schema import Range, Unit


def towards(rate: float, d: float, T: float) -> float:
    """Return the part of the way to the neighbours' mean in one period T (s); at most half, because they move as well.

    `rate` is the gain of each unit of c_ij (1/s): kappa for P_set, beta/k_q for V_set; `d` is their sum.
    """
    return 0.5 * (1.0 - exp(-2.0 * rate * d * T))


def P_set_step(
    P_set: float,
    y_bar: float,
    d: float,
    e: float,
    *,
    leader: bool,
    m_p: float,
    gains: Gains,
    T: float,
    kappa_c: float | None = None,
) -> float:
    """Return P_set (pu of own rating) after one control period T (s), (12) for a follower, (13) for a leader.

    `y_bar` is the weighted mean of the neighbours' m_p P_set (pu), without effect when `d`, the sum of c_ij, is 0; `e`
    is the own frequency error (pu), and `kappa_c` the gain of each unit of c_ij (1/s), by default kappa = m_p/k_p.
    """
    kappa = m_p / gains.k_p
    y = m_p * P_set
    change = towards(kappa if kappa_c is None else kappa_c, d, T) * (y_bar - y)
    if leader:
        change -= (1.0 - exp(-kappa * T)) * e
    return min(max(P_set + change / m_p, gains.P_set_min), gains.P_set_max)


def alpha_in_force(gains: Gains, v: float) -> float:
    r"""Return the weight of the voltage error (1) at a voltage v (pu): alpha, or less near nominal with V_full.

    .. math:: \alpha(v) = \max(\alpha_{min}, \alpha \min(1, |v - 1| / V_{full}))

    In equilibrium a leader's alpha (v - 1) balances its beta times the difference of vars. So alpha decides both
    how soon voltage recovers and how equal vars become. An alpha that is large far from nominal voltage and
    small near it eases this conflict. The paper mentions adaptive weights and gives none; this one is ours.

    Examples
    --------
    >>> adaptive = Gains(alpha=1.0, alpha_min=0.125, V_full=0.02)
    >>> [round(alpha_in_force(adaptive, v), 3) for v in (0.9, 0.99, 1.0)], alpha_in_force(Gains(), 1.001)
    ([1.0, 0.5, 0.125], 1.0)
    """
    if gains.V_full <= 0.0:
        return gains.alpha
    return max(gains.alpha_min, gains.alpha * min(1.0, abs(v - 1.0) / gains.V_full))


def V_factors(alpha: float, beta: float, d: float, *, k_q: float, T: float) -> tuple[float, float]:
    """Return the factors of z - z_bar and of v - 1 in one period: beta d and alpha of (15), times one F.

    With one F for both, they cancel where the paper's terms do, for every T (s). `alpha` is 0 for a follower, which
    makes it (14).
    """
    vars_ = beta * d
    if alpha > 2.0 * vars_:
        b = 1.0 - exp(-alpha * T / k_q)
        return b * vars_ / alpha, b
    a = towards(beta / k_q, d, T)
    return a, a * alpha / vars_ if vars_ > 0.0 else 0.0


def V_set_step(
    V_set: float, z: float, z_bar: float, d: float, v: float, *, leader: bool, gains: Gains, T: float
) -> float:
    """Return V_set (pu of nominal) after one control period T (s), (14) for a follower, (15) for a leader.

    `z` is the own m_q q (pu), `z_bar` the weighted mean of the neighbours', without effect when `d`, the sum of c_ij,
    is 0; `v` is the own terminal voltage (pu).
    """
    alpha, beta = (alpha_in_force(gains, v), gains.beta_GFM) if leader else (0.0, gains.beta_GFL)
    a, b = V_factors(alpha, beta, d, k_q=gains.k_q, T=T)
    change = -a * (z - z_bar)
    if leader:
        change -= b * (v - 1.0)
    return min(max(V_set + change, gains.V_set_min), gains.V_set_max)


class Consensus(Law):
    """The paper's law, (12)-(15): leaders restore frequency and voltage, all agree on shares of load and vars.

    Its parameters are those of `Gains`, which a scenario sets, under its `[degraded_communication]`.
    """

    source = (
        "Singhal et al., Consensus Control for Coordinating Grid-Forming and Grid-Following Inverters in Microgrids, "
        "IEEE Trans. Smart Grid 2022"
    )

    k_p: Annotated[float, Unit("s"), Range(1e-9, inf), "P_set gain; kappa = m_p/k_p is the rate (1/s)."] = 0.0007
    k_q: Annotated[float, Unit("s"), Range(1e-9, inf), "V_set gain."] = 0.25
    alpha: Annotated[float, Range(0, inf), "Weight of the voltage error in (15), leaders only."] = 1.0
    beta_GFM: Annotated[float, Range(0, inf), "Weight of equal var sharing in (15)."] = 1.0
    beta_GFL: Annotated[float, Range(0, inf), "Weight of equal var sharing in (14)."] = 1.0
    alpha_min: Annotated[float, Range(0, inf), "Least weight of a small voltage error, for V_full."] = 0.0
    V_full: Annotated[float, Unit("pu"), Range(0, inf), "Voltage error from which on alpha counts in full."] = 0.0
    kappa_c: Annotated[
        float, Unit("1/s"), Range(0, inf), "Gain of the consensus on m_p P_set over its mean; 0: m_p/k_p, over its sum."
    ] = 0.0

    def __init__(self, **parameters: Any) -> None:
        super().__init__(**parameters)
        self._gains = Gains(**{name: getattr(self, name) for name in Gains.__struct_fields__})

    def step(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> SetPoints:
        """Decide the set-points of one control period, (12) and (14) for a follower, (13) and (15) for a leader."""
        y_bar, z_bar, d = self._means(neighbours)
        # A saturated leader that cannot reduce the frequency error acts as a follower: it does not integrate it.
        leader = own.leader and -own.e * own.P_saturated <= 0.0
        P_set = P_set_step(
            own.P_set,
            y_bar,
            d,
            own.e,
            leader=leader,
            m_p=own.m_p,
            gains=self._gains,
            T=T,
            kappa_c=self.kappa_c or None,
        )
        V_set = V_set_step(own.V_set, own.z, z_bar, d, own.V, leader=own.leader, gains=self._gains, T=T)
        if (V_set - own.V_set) * own.V_saturated > 0.0:
            V_set = own.V_set
        return SetPoints(P_set, V_set)

    def terms(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> Terms:
        """Return the terms of (12) to (15): each neighbour's, the own errors', and what anti-windup takes back."""
        gains, m_p = self._gains, own.m_p
        _, _, d = self._means(neighbours)
        weights = sum(other.weight for other in neighbours)
        kappa, y = m_p / gains.k_p, m_p * own.P_set
        share = towards(self.kappa_c or kappa, d, T) / (m_p * weights) if weights else 0.0
        P = [Term("power sharing", share * n.weight * (n.m_p * n.P_set - y), n.name) for n in neighbours]
        if own.leader:
            error = Term("frequency error", -(1.0 - exp(-kappa * T)) * own.e / m_p)
            P.append(error)
            if own.e * own.P_saturated < 0.0:
                P.append(Term("anti-windup", -error.value))
        alpha, beta = (alpha_in_force(gains, own.V), gains.beta_GFM) if own.leader else (0.0, gains.beta_GFL)
        a, b = V_factors(alpha, beta, d, k_q=gains.k_q, T=T)
        share = a / weights if weights else 0.0
        V = [Term("var sharing", -share * n.weight * (own.z - n.m_q * n.Q), n.name) for n in neighbours]
        if own.leader:
            V.append(Term("voltage error", -b * (own.V - 1.0)))
        change = sum(term.value for term in V)
        limited = min(max(own.V_set + change, gains.V_set_min), gains.V_set_max)
        if (limited - own.V_set) * own.V_saturated > 0.0:
            V.append(Term("anti-windup", -change))
        return Terms(tuple(P), tuple(V))

    def _means(self, neighbours: Sequence[Neighbour]) -> tuple[float, float, float]:
        """Return the neighbours' mean m_p P_set and m_q q (pu), and the sum d of their weights c_ij."""
        y = z = d = 0.0
        for other in neighbours:
            y += other.weight * other.m_p * other.P_set
            z += other.weight * other.m_q * other.Q
            d += other.weight
        if d == 0.0:
            return 0.0, 0.0, 0.0
        return y / d, z / d, d / len(neighbours) if self.kappa_c else d
