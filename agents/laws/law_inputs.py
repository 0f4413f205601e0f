"""The inputs of a law: the own inverter and its neighbours, per unit of the rating of each. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.agents.laws.law import NOTHING_SHARED, Neighbour, Own
from gridpeers.wire.messages import Measurement, Nameplate, State

_converted: dict[str, tuple[State, Nameplate, float, float, Neighbour]] = {}
"""The last conversion of each sender: its neighbours in one process get the same state, one after the other."""


def neighbour_of(nameplate: Nameplate, state: State, age: float, weight: float) -> Neighbour:
    """Return a neighbour as a law sees it, per unit of the neighbour's own rating."""
    name = nameplate.sender
    known = _converted.get(name)
    if known is not None and known[0] is state and known[1] is nameplate and known[2] == age and known[3] == weight:
        return known[4]
    neighbour = Neighbour(
        name,
        nameplate.kind == "GFM",
        age,
        weight,
        state.P_set / nameplate.P_rated,
        state.V_set / nameplate.V_nom,
        state.Q / nameplate.P_rated,
        nameplate.m_p,
        nameplate.m_q,
        nameplate.P_rated,
        MappingProxyType(state.shared) if state.shared else NOTHING_SHARED,  # all agents of a process see this one
    )
    _converted[name] = state, nameplate, age, weight, neighbour
    return neighbour


def neighbours_alike(nameplates: Mapping[str, Nameplate], states: Iterable[State], t: float) -> list[Neighbour]:
    """Return the senders of some states as a law sees them at the time t (s), each with the weight 1.

    Of n agents that hear each other, each needs n - 1 neighbours a tick: most are converted already.
    """
    return [
        shown[4]
        if (shown := _converted.get(state.sender)) is not None
        and shown[0] is state
        and shown[2] == t - state.t
        and shown[3] == 1.0
        and shown[1] is nameplates[state.sender]
        else neighbour_of(nameplates[state.sender], state, t - state.t, 1.0)
        for state in states
    ]


def own_of(config: AgentConfig, m: Measurement, P_set: float, V_set: float, saturated: tuple[int, int]) -> Own:
    """Return the own inverter as a law sees it, with the set-points (W, V) before its step and the saturated sides."""
    P_rated, V_nom, m_q, f_nom = config.P_rated, config.V_nom, config.m_q, config.f_nom
    return Own(
        config.name,
        config.kind == "GFM",
        m.t,
        m.P / P_rated,
        m.Q / P_rated,
        m.V / V_nom,
        (m.f - f_nom) / f_nom,
        m_q * m.Q / P_rated,  # z
        P_set / P_rated,
        V_set / V_nom,
        config.m_p,
        m_q,
        P_rated,
        V_nom,
        f_nom,
        *saturated,
    )
