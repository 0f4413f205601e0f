"""The step of the paper's law by numbers: the terms of its equations added up, within its limits."""

from __future__ import annotations

from gridpeers.agents.agent_config import Gains
from gridpeers.agents.laws.consensus import P_change, V_change


def P_set_step(
    P_set: float, y_bar: float, d: float, e: float, *, leader: bool, m_p: float, gains: Gains, T: float,
    kappa_c: float | None = None,
) -> float:  # fmt: skip
    """Return P_set (pu) after one period, (12) or (13)."""
    kappa = m_p / gains.k_p
    change = sum(P_change(m_p * P_set, y_bar, d, e, leader, kappa, kappa if kappa_c is None else kappa_c, T))
    return min(max(P_set + change / m_p, gains.P_set_min), gains.P_set_max)


def V_set_step(
    V_set: float, z: float, z_bar: float, d: float, v: float, *, leader: bool, gains: Gains, T: float
) -> float:
    """Return V_set (pu) after one period, (14) or (15)."""
    return min(max(V_set + sum(V_change(z, z_bar, d, v, leader, gains, T)), gains.V_set_min), gains.V_set_max)
