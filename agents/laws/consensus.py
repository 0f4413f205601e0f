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
neighbours' mean with weights c_ij. To first order in T this is (12)-(15).

.. math::
    y &\leftarrow y + \tfrac12 (1 - e^{-2 \kappa d T}) (\bar y - y) - g (1 - e^{-\kappa T}) e \\
    V_{set} &\leftarrow V_{set} - F \big[ \beta d (z - \bar z) + g \alpha (v - 1) \big], \quad
        F = (1 - e^{-\lambda T/k_q}) / \lambda, \quad \lambda = \max(g \alpha, 2 \beta d)

Explicit Euler needs kappa T lambda_max < 2; nine fully meshed agents at T = 20 ms have 2.6. The consensus term is the
exact solution where neighbours move towards agent i as it moves towards them: at most half of the way, so no eigenvalue
of the consensus is below 0. The leader term is the exact solution against the own quasi-steady response de/dy = 1.
V_set rests where its bracket is 0, at every T, because both parts have the factor F. On the droop v + z = V_set, so
max(alpha, 2 beta d) bounds alpha dv/dV_set + 2 beta d dz/dV_set, and F does not overshoot. At rest L y = -g b e with
the Laplacian L and b > 0; its left null vector is positive and all e are equal, so e = 0 and all y agree.
`tests/unit/agents/test_law.py` searches for instability: only where the paper's continuous law is unstable too.

**Limits.** The agent limits P_set and V_set (anti-windup). The paper has no limits and accepts wind-up (its Remark 2).
`gridpeers.agents.degraded_communication` has these and other options, and other weights c_ij than 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from math import exp, inf
from typing import Annotated, Any

from gridpeers.agents.agent_config import Gains
from gridpeers.agents.laws.law import NOTHING_SHARED, Law, Neighbour, Own, SetPoints, Term, Terms
from gridpeers.wire.plain_sum import plain_sum
from gridpeers.wire.schema.table_schema import Range, Unit


def towards(rate: float, d: float, T: float) -> float:
    """Return the part of the way to the neighbours' mean in one period T (s); at most half, because they move as well.

    `rate` is the gain of each unit of c_ij (1/s): kappa for P_set, beta/k_q for V_set; `d` is their sum.
    """
    return 0.5 * (1.0 - exp(-2.0 * rate * d * T))


def P_change(
    y: float, y_bar: float, d: float, e: float, leader: bool, kappa: float, kappa_c: float, T: float
) -> tuple[float, float]:
    """Return both terms of the change of y = m_p P_set (pu) in a period T (s), (12) for a follower, (13) for a leader.

    The first is that of the neighbours, whose mean y with the weights c_ij is `y_bar`; it is linear in `y_bar`, and 0
    when `d`, the sum of c_ij, is 0. The second is that of the own frequency error `e` (pu). `kappa_c` is the gain of
    each unit of c_ij (1/s): that of the paper is kappa = m_p/k_p.
    """
    return towards(kappa_c, d, T) * (y_bar - y), -(1.0 - exp(-kappa * T)) * e if leader else 0.0


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


def V_change(z: float, z_bar: float, d: float, v: float, leader: bool, gains: Gains, T: float) -> tuple[float, float]:
    """Return both terms of the change of V_set (pu) in a period T (s), (14) for a follower, (15) for a leader.

    The first is that of the neighbours, whose mean z = m_q q (pu) is `z_bar`; it is linear in `z_bar`, and 0 when `d`,
    the sum of c_ij, is 0. The second is that of the own terminal voltage `v` (pu).
    """
    alpha, beta = (alpha_in_force(gains, v), gains.beta_GFM) if leader else (0.0, gains.beta_GFL)
    a, b = V_factors(alpha, beta, d, k_q=gains.k_q, T=T)
    return -a * (z - z_bar), -b * (v - 1.0)


class Consensus(Law):
    """The paper's law, (12)-(15): leaders restore frequency and voltage, all agree on shares of load and vars.

    A scenario sets its parameters in `[gains]` and `[degraded_communication]`.
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
        P_sharing, P_error = self._P_change(own, y_bar, d, T)
        V_sharing, V_error = self._V_change(own, z_bar, d, T)
        V_change = V_sharing + V_error
        # A saturated leader that cannot reduce the frequency error acts as a follower: it does not integrate it.
        P_held, V_held = own.e * own.P_saturated < 0.0, V_change * own.V_saturated > 0.0
        return SetPoints(
            own.P_set + (P_sharing if P_held else P_sharing + P_error) / own.m_p,
            own.V_set if V_held else own.V_set + V_change,
            NOTHING_SHARED,
            True,
            partial(self._terms, own, neighbours, d, T, (P_held, V_held)),
        )

    def _P_change(self, own: Own, y_bar: float, d: float, T: float) -> tuple[float, float]:
        kappa = own.m_p / self.k_p
        return P_change(own.m_p * own.P_set, y_bar, d, own.e, own.leader, kappa, self.kappa_c or kappa, T)

    def _V_change(self, own: Own, z_bar: float, d: float, T: float) -> tuple[float, float]:
        return V_change(own.z, z_bar, d, own.V, own.leader, self._gains, T)

    def _terms(self, own: Own, neighbours: Sequence[Neighbour], d: float, T: float, held: tuple[bool, bool]) -> Terms:
        """Split the changes of a step: each neighbour's in place of their mean, and what anti-windup takes back."""
        weights = plain_sum(n.weight for n in neighbours) or 1.0
        m_p, (_, P_error), (_, V_error) = own.m_p, self._P_change(own, 0.0, d, T), self._V_change(own, 0.0, d, T)
        P, V = [], []
        for n in neighbours:
            share = n.weight / weights
            P.append(Term("power sharing", share * self._P_change(own, n.m_p * n.P_set, d, T)[0] / m_p, n.name))
            V.append(Term("var sharing", share * self._V_change(own, n.m_q * n.Q, d, T)[0], n.name))
        if own.leader:
            P.append(Term("frequency error", P_error / m_p))
            V.append(Term("voltage error", V_error))
        if held[0] and own.leader:
            P.append(Term("anti-windup", -P_error / m_p))
        if held[1]:
            V.append(Term("anti-windup", -plain_sum(term.value for term in V)))
        return Terms(P, V)

    def _means(self, neighbours: Sequence[Neighbour]) -> tuple[float, float, float]:
        y = z = d = 0.0
        for other in neighbours:
            weight = other.weight
            y += weight * other.m_p * other.P_set
            z += weight * other.m_q * other.Q
            d += weight
        if d == 0.0:
            return 0.0, 0.0, 0.0
        return y / d, z / d, d / len(neighbours) if self.kappa_c else d
