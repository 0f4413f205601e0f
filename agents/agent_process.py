"""An agent as a process: `LockstepAgent` or `RealtimeAgent` on a Zenoh session."""

from __future__ import annotations

import logging
from contextlib import closing
from time import time_ns

from msgspec.structs import replace

from agents.agent_config import AgentConfig
from agents.carriers.make import make_law
from agents.laws.law import Law
from agents.lockstep_agent import LockstepAgent
from agents.realtime.realtime_agent import RealtimeAgent
from wire.driver.drive import StoppedError, drive, serve
from wire.driver.process import ConfigurationError, MakeLinks, no_links
from wire.driver.session import Session
from wire.keys import check_name


def run_agent(config: AgentConfig, make_links: MakeLinks = no_links) -> str:
    """Take part in a run until it ends.

    Parameters
    ----------
    config : AgentConfig
        The agent's nameplate, the run's rule, and the rendezvous.
    make_links : MakeLinks, optional
        Makes the emulated links, if there are any.

    Returns
    -------
    str
        Why the agent could not continue; empty if the run ended with a `Stop`.

    Raises
    ------
    ConfigurationError, SessionError
        If the configuration cannot work. In wall-clock time also if the plant refuses the agent, or there is none
        within the deadline.
    """
    log = logging.getLogger(config.name)
    try:
        check_name("run", config.run)
        check_name("name", config.name)
    except ValueError as error:
        raise ConfigurationError(str(error)) from None
    wall = config.clock == "wall"
    if wall:  # each process has an epoch of its own, which tells it from its ghost; only equality matters
        config = replace(config, epoch=max(config.epoch, time_ns() // 1_000_000))
    try:
        law = make_law(config.control)
    except ValueError as error:
        raise ConfigurationError(f"{config.name}: {error}") from None
    with closing(law):
        node = _one_session_after_the_other(config, make_links, law, log)
    if node.rejects.counts:
        log.warning("%s: dropped messages by kind: %s", config.name, dict(node.rejects.counts))
    if not node.failed:
        log.info("%s: %s", config.name, node.stopped)
        return ""
    failed = node.failed
    if not node.plant_seen:
        failed += f"; is the plant of run {config.run} running at {', '.join(config.connect)}?"
    if wall:
        raise ConfigurationError(failed)
    return failed


def _one_session_after_the_other(
    config: AgentConfig, make_links: MakeLinks, law: Law, log: logging.Logger
) -> RealtimeAgent | LockstepAgent:
    """Take part with one session, and open a new one whenever the last was broken."""
    node: RealtimeAgent | LockstepAgent | None = None
    while node is None or (isinstance(node, RealtimeAgent) and node.session_broken):
        session = Session(config.name, listen=config.listen, connect=config.connect, clock=config.clock)
        try:
            if node is None:
                try:
                    links = make_links(config.name, config.links)
                    node = (RealtimeAgent if config.clock == "wall" else LockstepAgent)(config, session.id, links, law)
                except ValueError as error:
                    raise ConfigurationError(str(error)) from None
            _take_part(node, session, log)
        finally:
            session.close()
    return node


def _take_part(node: RealtimeAgent | LockstepAgent, session: Session, log: logging.Logger) -> None:
    """Take part with one session. All of an agent's sessions hold one token, so the others see one agent."""
    session.answer(*node.nameplate)
    for key in node.publications:
        session.prepare(key)
    try:
        drive(node, session, log)
    except (StoppedError, KeyboardInterrupt) as stop:
        if isinstance(node, RealtimeAgent):
            node.leave(f"asked to leave: {stop}")
            serve(node, session, log)  # until the plant has acknowledged
        raise
