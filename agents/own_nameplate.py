"""An agent's own nameplate, which introduces it to the others. Pure."""

from __future__ import annotations

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.wire.codec import RejectedError, decode, encode
from gridpeers.wire.messages import Nameplate


def nameplate_of(config: AgentConfig) -> Nameplate:
    """Make the nameplate of an agent from its configuration."""
    return Nameplate(
        sender=config.name,
        epoch=config.epoch,
        seq=0,
        t=0.0,
        kind=config.kind,
        microgrid=config.microgrid,
        P_rated=config.P_rated,
        V_nom=config.V_nom,
        f_nom=config.f_nom,
        m_p=config.m_p,
        m_q=config.m_q,
    )


def check_nameplate(config: AgentConfig) -> None:
    """Raise ValueError if a value of an agent's nameplate is out of bounds, so that every receiver would reject it."""
    try:
        decode(encode(nameplate_of(config)))
    except RejectedError as rejected:
        raise ValueError(f"{config.name}: every participant would reject this nameplate: {rejected.text}") from None
