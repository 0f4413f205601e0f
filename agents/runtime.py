"""An agent as a process: `agents.lockstep` on a Zenoh session."""

from __future__ import annotations

import logging

from agents.config import AgentConfig
from agents.lockstep import AgentSide
from wire.drive import drive
from wire.keys import check_name
from wire.process import ConfigurationError
from wire.session import Session


def run_agent(config: AgentConfig) -> str:
    """Take part in a run until it ends.

    Parameters
    ----------
    config : AgentConfig
        Who the agent is, the run's rule, and where the rendezvous is.

    Returns
    -------
    str
        Why the agent could not go on; empty if the run ended and said so.

    Raises
    ------
    ConfigurationError, SessionError
        If the configuration cannot work.
    """
    log = logging.getLogger(config.name)
    try:
        check_name("run", config.run)
        check_name("name", config.name)
    except ValueError as error:
        raise ConfigurationError(str(error)) from None
    session = Session(config.name, listen=config.listen, connect=config.connect)
    try:
        side = AgentSide(config, session.id)
        session.answer(*side.nameplate)
        for key in side.publications:
            session.prepare(key)
        drive(side, session, log)
    finally:
        session.close()
    if side.rejects.counts:
        log.warning("%s: dropped messages by kind: %s", config.name, dict(side.rejects.counts))
    if not side.failed:
        log.info("%s: %s", config.name, side.stopped)
    elif not side.plant_seen:
        return f"{side.failed}; is the plant of run {config.run} running at {', '.join(config.connect)}?"
    return side.failed
