"""Requests to a running plant: status, commands to switches and agents, and configurations of agents."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Iterator, Mapping
from time import monotonic
from typing import Any, Literal, TypeVar

import msgspec

from agents.agent_config import AgentConfig
from agents.own_nameplate import check_nameplate
from scenarios.emulation.emulation_config import EmulationConfig
from scenarios.live.run_client import NobodyError, RunClient
from scenarios.live.show.run_monitor import PlantStatus
from scenarios.short_names import in_order
from wire.bounds import MOST_COUNT
from wire.codec import encode
from wire.driver.command_line import command_line
from wire.messages import Answer, Command, LinkAcknowledgement, LoadSetting
from wire.printable import printable

T = TypeVar("T")

Verb = Literal["open", "close", "synchronise", "load", "stop", "down", "status", "link", "links"]

ANSWER = 10.0
"""Longest wait (s) for the answer of a plant that is there; on a busy machine it may take a second."""

ACKNOWLEDGED = 4.0
"""Longest wait (s) for the receivers of a link command; one control period, or a second more if a message was lost."""

HANDOUT = 10.0
"""Longest wait (s) for a configuration that the plant hands out; it answers within milliseconds, or a busy second."""

AGAIN = 0.1
"""Time (s) between two requests for the same thing."""

LEAVING = 10.0
"""Longest wait (s) for processes that were asked to leave."""


class RefusedError(ValueError):
    """The plant has refused a command; the message is the plant's."""


def ask(client: RunClient, verb: Verb, argument: str = "", load: LoadSetting | None = None) -> str:
    """Give the plant a command and return its answer.

    Raises
    ------
    RefusedError
        If the plant refuses.
    NobodyError
        If it does not answer.
    """
    answer, _ = request(client, lambda answer: set(), verb=verb, argument=argument, load=load)
    return answer.text


def request(
    client: RunClient, receivers: Callable[[Answer], set[str]], *, verb: Verb, **command_fields: Any
) -> tuple[Answer, dict[str, LinkAcknowledgement]]:
    """Give the plant a command; return its answer, and those that come in time of the receivers that follow from it.

    Anybody who may ask the plant anything may have its answer sent to this client. So the command has a number that
    nobody else knows, which the plant repeats; acknowledgements have the number that the plant's answer names.
    """
    number = secrets.randbelow(MOST_COUNT)
    command = Command(sender="visitor", epoch=0, seq=number, t=0.0, reply_to=client.id, verb=verb, **command_fields)
    client.publish(client.keys.for_verb(verb), encode(command))
    answer: Answer | None = None
    acknowledgements: dict[int, dict[str, LinkAcknowledgement]] = {}
    end = monotonic() + ANSWER
    while (left := end - monotonic()) > 0.0:
        for key, payload, _ in client.take(left):
            message = client.read(key, payload)
            if isinstance(message, LinkAcknowledgement):
                acknowledgements.setdefault(message.seq, {})[message.sender] = message
            elif isinstance(message, Answer) and message.seq == number:
                if not message.ok:
                    raise RefusedError(message.text)
                answer, end = message, monotonic() + ACKNOWLEDGED
        if answer is not None and _of_number(answer, acknowledgements).keys() >= receivers(answer):
            break
    if answer is None:
        raise NobodyError(
            f"the plant of {client.where} is there but has not answered within {ANSWER:g} s; is it frozen?"
        )
    return answer, _of_number(answer, acknowledgements)


def _of_number(
    answer: Answer, acknowledgements: Mapping[int, dict[str, LinkAcknowledgement]]
) -> dict[str, LinkAcknowledgement]:
    """Return the acknowledgements of the number that an answer names."""
    number = answer.data.get("number")
    return acknowledgements.get(number, {}) if isinstance(number, int) else {}


def plant_status(client: RunClient) -> PlantStatus:
    """Return the state of the run as the plant reports it."""
    answer, _ = request(client, lambda answer: set(), verb="status")
    return data_of(client, answer, PlantStatus)


def data_of(client: RunClient, answer: Answer, kind: type[T]) -> T:
    """Return the data of an answer.

    Raises
    ------
    NobodyError
        If they are something else: anybody may answer as a plant on open links, and one of another version may.
    """
    try:
        return msgspec.convert(answer.data, kind)
    except msgspec.ValidationError as error:
        raise NobodyError(
            f"the plant of {client.where} answers what cannot be read here: {printable(str(error), 200)}; is it of "
            "another version?"
        ) from None


def has_left(client: RunClient, name: str) -> bool:
    """Wait until an agent that was asked to leave has left; return whether it has."""
    end = monotonic() + LEAVING
    while name in plant_status(client).agents:
        if monotonic() > end:
            return False
        client.until(lambda: False, AGAIN)
    return True


def has_ended(client: RunClient) -> bool:
    """Wait until a run that was asked to end has ended; return whether it has. Its plant leaves last."""
    return client.until(lambda: not client.plant, LEAVING)


# ---- configurations of agents


def configuration(client: RunClient, name: str) -> AgentConfig:
    """Return the configuration that the plant hands out to the agent of an inverter.

    Raises
    ------
    NobodyError
        If there is no such inverter.
    """
    known = configurations(client, name)
    if name not in known:
        there = f"inverters are {', '.join(in_order(known))}" if known else "the plant has no configuration for it"
        raise NobodyError(f'no inverter "{name}" in {client.where}; {there}')
    return known[name]


def configurations(client: RunClient, name: str = "") -> dict[str, AgentConfig]:
    """Return configurations of agents by name: all that came until that of `name`, or any, was there.

    With the certificate of an agent it asks for that of `name` alone: access rules let an agent ask for no other.
    """
    known: dict[str, AgentConfig] = {}
    credentials = client.where.credentials
    is_agent = credentials is not None and credentials.own.role == "agent"
    client.fetch(client.keys.config(name if is_agent else "*"))
    end = monotonic() + HANDOUT
    while not (name in known if name else known) and (left := end - monotonic()) > 0.0:
        for _, payload, _ in client.take(left):
            config = read_config(payload)
            if config is not None:
                known[config.name] = config
    return known


def read_config(payload: bytes) -> AgentConfig | None:
    """Return a plausible configuration of an agent; None if the bytes are something else."""
    if not payload.startswith(b"{"):
        return None
    try:
        config = msgspec.json.decode(payload, type=AgentConfig)
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
            f"({command_line('stop', name)}), or start the agent of another inverter"
        )


def own_code(config: AgentConfig) -> tuple[str, ...]:
    """Return the code that a configuration names beside gridpeers' own and installed plug-ins, in words.

    Examples
    --------
    >>> from agents.agent_config import Control, LawChoice
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
