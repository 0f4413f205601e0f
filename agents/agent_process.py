"""One agent or several as a process: `LockstepAgent` or `RealtimeAgent`, behind one Zenoh session."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from contextlib import ExitStack, closing

from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.agents.agent_sessions import AgentSessions
from gridpeers.agents.carriers.make import make_law
from gridpeers.agents.laws.law import Law
from gridpeers.wire.driver.process import ConfigurationError, MakeLinks, new_epoch, no_links
from gridpeers.wire.driver.scheduling import schedule_as_batch
from gridpeers.wire.keys import check_name

AgentProcess = AgentConfig | tuple[AgentConfig, ...]
"""Configuration of a process: one agent, or several."""


def run_agents(process: AgentProcess, make_links: MakeLinks = no_links) -> str:
    """Take part in a run until it ends.

    Parameters
    ----------
    process : AgentConfig or tuple[AgentConfig, ...]
        Each agent's nameplate, the run's rule, and the rendezvous. Agents of one process share a session; they are of
        one run, under one kind of time.
    make_links : MakeLinks, optional
        Makes the emulated links, if there are any.

    Returns
    -------
    str
        Why an agent could not continue; empty if the run ended with a `Stop`.

    Raises
    ------
    ConfigurationError, SessionError
        If the configuration cannot work. In wall-clock time also if the plant refuses an agent, or there is none
        within the deadline.
    """
    configs = process if isinstance(process, tuple) else (process,)
    _check(configs)
    wall = configs[0].clock == "wall"
    if wall:  # each process has an epoch of its own, which tells it from its ghost; only equality matters
        configs = tuple(replace(config, epoch=new_epoch()) for config in configs)
    else:
        schedule_as_batch()
    with ExitStack() as laws:
        nodes = AgentSessions(configs, _made_laws(configs, laws), make_links).run()
    failures = []
    for config, node in zip(configs, nodes, strict=True):
        log = logging.getLogger(config.name)
        if node.rejects.counts:
            log.warning("%s: dropped messages by kind: %s", config.name, dict(node.rejects.counts))
        if not node.failed:
            log.info("%s: %s", config.name, node.stopped)
            continue
        asks = "" if node.plant_seen else f"; is the plant of run {config.run} running at {', '.join(config.connect)}?"
        failures.append(f"{node.failed}{asks}")
    if failures and wall:
        raise ConfigurationError("\n".join(failures))
    return "\n".join(failures)


def _check(configs: Sequence[AgentConfig]) -> None:
    """Raise ConfigurationError unless these agents can share a process."""
    if not configs:
        raise ConfigurationError("the configuration names no agent")
    try:
        for config in configs:
            check_name("run", config.run)
            check_name("name", config.name)
    except ValueError as error:
        raise ConfigurationError(str(error)) from None
    first = configs[0]
    for config in configs[1:]:
        for key in ("run", "clock", "listen", "connect", "star"):
            if getattr(config, key) != getattr(first, key):
                raise ConfigurationError(
                    f"{config.name}: {key} {getattr(config, key)!r} differs from that of {first.name}; "
                    "agents of one process share it"
                )
    if len(configs) > 1 and first.credentials is not None:
        raise ConfigurationError(f"agents of one process have one certificate; start that of {configs[1].name} alone")
    names = [config.name for config in configs]
    if twice := [name for name in dict.fromkeys(names) if names.count(name) > 1]:
        raise ConfigurationError(f"agents {', '.join(twice)} stand twice in the configuration")


def _made_laws(configs: Sequence[AgentConfig], laws: ExitStack) -> list[Law]:
    """Return the law of each agent, which ends with the stack."""
    made: list[Law] = []
    for config in configs:
        try:
            made.append(laws.enter_context(closing(make_law(config.control))))
        except ValueError as error:
            raise ConfigurationError(f"{config.name}: {error}") from None
    return made
