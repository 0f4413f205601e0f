"""One agent or several as a process, behind one Zenoh session after the other."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from contextlib import ExitStack, closing
from time import monotonic, sleep

from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.agents.agent_node import AgentNode
from gridpeers.agents.carriers.law_registry import make_law
from gridpeers.agents.laws.law import Law
from gridpeers.agents.roster_meeting import KnownAgents
from gridpeers.wire.driver.drive import StoppedError, drive, serve
from gridpeers.wire.driver.machine import schedule_as_batch
from gridpeers.wire.driver.process import ConfigurationError, MakeLinks, new_epoch, no_links
from gridpeers.wire.driver.session import Session, SessionError
from gridpeers.wire.keys import check_name
from gridpeers.wire.node_group import NodeGroup
from gridpeers.wire.trust.credentials import Credentials

AgentProcess = AgentConfig | tuple[AgentConfig, ...]  # Configuration of a process: one agent, or several

OPENED_AGAIN, OPENED_WITHIN = 1.0, 60.0
"""Time (s) between two tries to open a session in place of a broken one, and time (s) for all of them."""


def run_agents(process: AgentProcess, make_links: MakeLinks = no_links) -> str:
    """Take part in a run until it ends; return why an agent could not continue, empty if the run ended with a `Stop`.

    Agents of one process share a session; they are of one run, under one kind of time.

    Raise ConfigurationError, SessionError if the configuration cannot work. In real time also if the plant
    refuses an agent, or there is none within the deadline.
    """
    configs = process if isinstance(process, tuple) else (process,)
    _check(configs)
    realtime = configs[0].clock == "realtime"
    if realtime:  # each process has an epoch of its own, which tells it from its ghost; only equality matters
        configs = tuple(replace(config, epoch=new_epoch()) for config in configs)
    else:
        schedule_as_batch()
    with ExitStack() as laws:
        nodes = _run(configs, _made_laws(configs, laws), make_links)
    failures = []
    for config, node in zip(configs, nodes, strict=True):
        log = logging.getLogger(config.name)
        if node.rejects.counts:
            log.warning("%s: dropped messages by kind: %s", config.name, dict(node.rejects.counts))
        if not node.failed:
            log.info("%s: %s", config.name, node.stopped)
            continue
        seen, places = node.policy.plant_seen, ", ".join(config.connect)
        asks = "" if seen else f"; is the plant of run {config.run} running at {places}?"
        failures.append(f"{node.failed}{asks}")
    if failures and realtime:
        raise ConfigurationError("\n".join(failures))
    return "\n".join(failures)


def _check(configs: Sequence[AgentConfig]) -> None:
    if not configs:
        raise ConfigurationError("the configuration names no agent")
    try:
        for config in configs:
            check_name("run", config.run)
            check_name("name", config.name)
    except ValueError as error:
        raise ConfigurationError(str(error)) from None
    if len(configs) > 1 and configs[0].credentials is not None:
        raise ConfigurationError(f"a process has one certificate; start the agent of {configs[1].name} in its own")


def _made_laws(configs: Sequence[AgentConfig], laws: ExitStack) -> list[Law]:
    made: list[Law] = []
    for config in configs:
        try:
            made.append(laws.enter_context(closing(make_law(config.control))))
        except ValueError as error:
            raise ConfigurationError(f"{config.name}: {error}") from None
    return made


def _run(configs: Sequence[AgentConfig], laws: Sequence[Law], make_links: MakeLinks) -> tuple[AgentNode, ...]:
    """Take part until all agents have finished, with a new session whenever the last was broken; return the agents."""
    first = configs[0]
    credentials = None if first.credentials is None else first.credentials.knowing(first.inverters)
    nodes: tuple[AgentNode, ...] = ()
    core: AgentNode | NodeGroup | None = None
    while core is None or core.session_broken:
        session = _opened(first, credentials, again=core is not None)
        try:
            if core is None:
                known: list[KnownAgents] = []  # one for each rule among the agents
                nodes = tuple(
                    _node(config, session.id, make_links, law, known) for config, law in zip(configs, laws, strict=True)
                )
                core = nodes[0] if len(nodes) == 1 else NodeGroup(nodes)
            if credentials is not None:
                for node in nodes:
                    node.post.vouches = session.vouches
            take_part(core, nodes, session, logging.getLogger(first.name))
        finally:
            session.close()
    return nodes


def _opened(config: AgentConfig, credentials: Credentials | None, *, again: bool) -> Session:
    """Open a session; one in place of another is tried again for a while, as its certificate may just be renewed."""
    until = monotonic() + (OPENED_WITHIN if again else 0.0)
    while True:
        try:
            return Session(
                config.name,
                listen=config.listen,
                connect=config.connect,
                clock=config.clock,
                star=config.star,
                credentials=credentials,
            )
        except SessionError as error:
            if monotonic() >= until:
                raise
            logging.getLogger(config.name).warning("%s; tries again for up to %g s", error, OPENED_WITHIN)
        sleep(OPENED_AGAIN)


def _node(config: AgentConfig, instance: str, make_links: MakeLinks, law: Law, shared: list[KnownAgents]) -> AgentNode:
    try:
        links = make_links(config.name, config.links)
        known = next((each for each in shared if each.control == config.control), None) or KnownAgents(config.control)
        shared.append(known)
        return AgentNode(config, instance, links, law, known)
    except ValueError as error:
        raise ConfigurationError(str(error)) from None


def take_part(core: AgentNode | NodeGroup, nodes: Sequence[AgentNode], session: Session, log: logging.Logger) -> None:
    """Take part with one session. All of an agent's sessions hold one token, so the others see one agent."""
    for node in nodes:
        session.answer(*node.nameplate)
        for key in node.publications:
            session.prepare(key)
    try:
        drive(core, session, log)
    except (StoppedError, KeyboardInterrupt) as stop:
        if not nodes[0].policy.grants:
            for node in nodes:
                node.leave(f"asked to leave: {stop}")
            serve(core, session, log)  # until the plant has acknowledged
        raise
