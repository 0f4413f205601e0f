"""Configurations of agents as the plant hands them out, and what stands against starting an agent with one."""

from __future__ import annotations

from collections.abc import Iterator
from time import monotonic

import msgspec

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.agents.own_nameplate import check_nameplate
from gridpeers.scenarios.emulation.emulation_config import EmulationConfig
from gridpeers.scenarios.live.client.run_client import NobodyError, RunClient
from gridpeers.scenarios.live.requests.run_requests import ANSWER, ASKED_AGAIN, plant_status
from gridpeers.scenarios.short_names import in_order
from gridpeers.wire.driver.command_line import command_line
from gridpeers.wire.foreign_bytes import decode_foreign


def configuration(client: RunClient, name: str, wait: float = ANSWER) -> AgentConfig:
    """Return the configuration that the plant hands out to the agent of an inverter.

    Raises
    ------
    NobodyError
        If the plant says that there is no such inverter, or does not answer within `wait` (s).
    """
    end = monotonic() + wait
    inverters = plant_status(client, wait).inverters
    if name not in inverters:
        there = f"inverters are {', '.join(in_order(inverters))}"
        raise NobodyError(f'no inverter "{name}" in {client.where}; {there}')
    return configurations(client, name, end - monotonic())[name]


def configurations(client: RunClient, name: str = "", wait: float = ANSWER) -> dict[str, AgentConfig]:
    """Return configurations of agents by name: all that came until that of `name`, or any, was there.

    With the certificate of an agent it asks for that of `name` alone: access rules let an agent ask for no other.

    Raises
    ------
    NobodyError
        If it does not come within `wait` (s), asked for again and again.
    """
    known: dict[str, AgentConfig] = {}
    credentials = client.where.credentials
    is_agent = credentials is not None and credentials.own.role == "agent"
    key = client.keys.config(name if is_agent else "*")
    now = ask_at = monotonic()
    end = now + wait
    while not (name in known if name else known):
        if now >= end:
            what = f"the configuration of {name}" if name else "a configuration"
            raise NobodyError(f"no answer: the plant of {client.where} has not sent {what} within {wait:.3g} s")
        if now >= ask_at:
            client.fetch(key)
            ask_at = now + ASKED_AGAIN
        for _, payload, _ in client.take(min(end, ask_at) - now):
            config = read_config(payload)
            if config is not None:
                known[config.name] = config
        now = monotonic()
    return known


def read_config(payload: bytes) -> AgentConfig | None:
    """Return a plausible configuration of an agent; None if the bytes are something else."""
    if not payload.startswith(b"{"):
        return None
    try:
        config = decode_foreign(msgspec.json.Decoder(AgentConfig).decode, payload)
        check_nameplate(config)
    except (msgspec.DecodeError, ValueError):
        return None
    return config


def check_free(client: RunClient, name: str) -> None:
    """Raise NobodyError if an agent of this name takes part already, before a second one says anything in the run.

    Of two that come at the same moment the plant refuses one.
    """
    if name in plant_status(client).agents:
        raise NobodyError(
            f"{name}: another agent of this name takes part in run {client.where.run} already; stop it first "
            f"({command_line('stop', name, *client.where.words)}), or start the agent of another inverter"
        )


def own_code(config: AgentConfig) -> tuple[str, ...]:
    """Return the code that a configuration names beside gridpeers' own and installed plug-ins, in words.

    Examples
    --------
    >>> from gridpeers.agents.agent_config import Control, LawChoice
    >>> control = Control(secondary="all", graph="full", law=LawChoice(command=("./mylaw",)))
    >>> own_code(AgentConfig(run="demo", name="inv1", kind="GFM", microgrid="mg1", P_rated=6e5, V_nom=277.0, f_nom=60.0,
    ...     m_p=0.01, m_q=0.05, T_c=0.02, control=control, deadline=10.0, connect=()))
    ('the law ./mylaw',)
    """
    return tuple(_named(config))


def _named(config: AgentConfig) -> Iterator[str]:
    law, graph = config.control.law, config.control.own_graph
    if law.command or law.fmu or ":" in law.use:
        yield f"the law {law.name}"
    if graph is not None and ":" in graph.use:
        yield f"the graph {graph.use}"
    if config.links:
        for fault in EmulationConfig.of_tree(config.links).netem.links:
            yield from (f"the link fault {plugin.use}" for plugin in fault.own if ":" in plugin.use)
