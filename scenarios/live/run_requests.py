"""Requests to a running plant: its status, configurations of agents, and commands to switches, loads and agents."""

from __future__ import annotations

import secrets
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from math import inf
from time import monotonic
from typing import Any, Literal, NamedTuple, TypeVar

import msgspec

from gridpeers.agents.agent_config import AgentConfig, check_nameplate
from gridpeers.plant.equipment.named_loads import FACTOR
from gridpeers.scenarios.console import in_order
from gridpeers.scenarios.emulation.link_data import EmulationConfig, LinkCommand
from gridpeers.scenarios.live.run_address import UsageError
from gridpeers.scenarios.live.run_client import NobodyError, RunClient
from gridpeers.scenarios.live.run_monitor import PlantStatus
from gridpeers.wire.codec import decode_foreign, encode
from gridpeers.wire.driver.command_line import command_line
from gridpeers.wire.messages import MOST_COUNT, PLANT, Answer, Command, LinkAcknowledgement, LoadSetting
from gridpeers.wire.schema.table_schema import Problem, Range
from gridpeers.wire.wording import InputError, printable

T = TypeVar("T")

Verb = Literal["open", "close", "synchronise", "load", "stop", "down", "status", "link"]

ANSWER = 10.0  # Longest wait (s) for the answer of a plant that is there; on a busy machine it may take a second

ASKED_AGAIN = 1.0
"""Time (s) after which a question without an answer is asked again: it may have been lost with its link."""

ACKNOWLEDGED = 4.0
"""Longest wait (s) for the receivers of a link command; one control period, or a second more if a message was lost."""

LEAVING = 10.0  # Longest wait (s) for processes that were asked to leave


class RefusedError(InputError):
    """The plant has refused a command; the message is the plant's."""


def ask(client: RunClient, verb: Verb, argument: str = "", load: LoadSetting | None = None) -> str:
    """Give the plant a command and return its answer; RefusedError if it refuses, NobodyError if it does not answer."""
    return request(client, verb=verb, argument=argument, load=load)[0].text


def request(
    client: RunClient,
    receivers: Callable[[Answer], set[str]] = lambda answer: set(),
    *,
    verb: Verb,
    wait: float = ANSWER,
    **command_fields: Any,
) -> tuple[Answer, dict[str, LinkAcknowledgement]]:
    """Give the plant a command; return its answer, and those of its `receivers` that come in time.

    The command has a number that nobody else knows, which the plant repeats: anybody may have answers sent here.
    Acknowledgements have the number that the plant's answer names. Only a question is asked again.
    """
    number = secrets.randbelow(MOST_COUNT)
    command = Command(sender="visitor", epoch=0, seq=number, t=0.0, reply_to=client.id, verb=verb, **command_fields)
    answers: list[Answer] = []
    came: dict[int, dict[str, LinkAcknowledgement]] = defaultdict(dict)

    def take(key: str, payload: bytes) -> None:
        message = client.read(key, payload)
        if isinstance(message, LinkAcknowledgement):
            came[message.seq][message.sender] = message
        elif isinstance(message, Answer) and message.seq == number:
            answers.append(message)

    def give() -> None:
        client.publish(client.keys.for_verb(verb), encode(command))

    again = ASKED_AGAIN if verb == "status" else inf
    if not _hear(client, take, lambda: bool(answers), wait, give, again):
        raise NobodyError(
            f"the plant of {client.where} is there but has not answered within {wait:.3g} s; is it frozen?"
        )
    answer = answers[0]
    if not answer.ok:
        raise RefusedError(answer.text)
    awaited, named = receivers(answer), answer.data.get("number")
    acknowledged = came[named] if isinstance(named, int) else {}  # anybody may have sent the answer
    _hear(client, take, lambda: acknowledged.keys() >= awaited, ACKNOWLEDGED)
    return answer, acknowledged


def _hear(
    client: RunClient,
    take: Callable[[str, bytes], None],
    done: Callable[[], bool],
    wait: float,
    ask: Callable[[], None] = lambda: None,
    again: float = inf,
) -> bool:
    """Ask, and `again` (s) later, and take what comes until it is `done`; return False if that takes `wait` (s)."""
    now = ask_at = monotonic()
    end = now + wait
    while not done():
        if now >= end:
            return False
        if now >= ask_at:
            ask()
            ask_at = now + again
        for key, payload, _ in client.take(min(end, ask_at) - now):
            take(key, payload)
        now = monotonic()
    return True


def plant_status(client: RunClient, wait: float = ANSWER) -> PlantStatus:
    return data_of(client, request(client, verb="status", wait=wait)[0], PlantStatus)


def data_of(client: RunClient, answer: Answer, kind: type[T]) -> T:
    """Return the data of an answer; NobodyError if it has another form, as of a plant of another version."""
    try:
        return msgspec.convert(answer.data, kind)
    except msgspec.ValidationError as error:
        raise NobodyError(
            f"the answer of the plant of {client.where} cannot be read: {printable(str(error), 200)}; has it another "
            "version?"
        ) from None


def has_left(client: RunClient, name: str) -> bool:
    """Wait until an agent that was asked to leave has left; return False if it stays."""
    end = monotonic() + LEAVING
    while name in plant_status(client).agents:
        if monotonic() > end:
            return False
        client.until(lambda: False, 0.1)
    return True


def has_ended(client: RunClient) -> bool:
    return client.until(lambda: not client.plant, LEAVING)


def free_configurations(client: RunClient, names: tuple[str, ...], wait: float = ANSWER) -> list[AgentConfig]:
    """Return what the plant hands out, in `wait` (s), to agents that can start here.

    NobodyError if there is no such inverter, or if another agent of it takes part; of two agents that start at the same
    moment the plant refuses one.
    """
    end = monotonic() + wait
    status = plant_status(client, wait)
    for name in names:
        if name not in status.inverters:
            listed = ", ".join(in_order(status.inverters))
            raise NobodyError(f'no inverter "{name}" in {client.where}; inverters are {listed}')
        if name in status.agents:
            raise NobodyError(
                f"{name}: another agent of this name takes part in run {client.where.run} already; stop it first "
                f"({command_line('stop', name, *client.where.words)}), or start the agent of another inverter"
            )
    return [configurations(client, name, end - monotonic())[name] for name in names]


def configurations(client: RunClient, name: str = "", wait: float = ANSWER) -> dict[str, AgentConfig]:
    """Return configurations by name: all that came until that of `name`, or any, was there, or NobodyError.

    With the certificate of an agent it asks for that of `name` alone: access rules let an agent ask for no other.
    """
    known: dict[str, AgentConfig] = {}
    credentials = client.where.credentials
    is_agent = credentials is not None and credentials.own.role == "agent"

    def ask_plant() -> None:
        client.fetch(client.keys.config(name if is_agent else "*"))

    def take(_: str, payload: bytes) -> None:
        if config := read_config(payload):
            known[config.name] = config

    if not _hear(client, take, lambda: name in known if name else bool(known), wait, ask_plant, ASKED_AGAIN):
        what = f"the configuration of {name}" if name else "a configuration"
        raise NobodyError(f"no answer: the plant of {client.where} has not sent {what} within {wait:.3g} s")
    return known


def read_config(payload: bytes) -> AgentConfig | None:
    if not payload.startswith(b"{"):
        return None
    try:
        config = decode_foreign(msgspec.json.Decoder(AgentConfig).decode, payload)
        check_nameplate(config)
    except (msgspec.DecodeError, ValueError):
        return None
    return config


def own_code(config: AgentConfig) -> Iterator[str]:
    """Yield the code that a configuration names beside gridpeers' own and installed plug-ins, in words."""
    law, graph = config.control.law, config.control.own_graph
    if law.command or law.fmu or ":" in law.use:
        yield f"the law {law.name}"
    if graph is not None and ":" in graph.use:
        yield f"the graph {graph.use}"
    if config.links:
        for fault in EmulationConfig.of_tree(config.links).netem.links:
            yield from (f"the link fault {plugin.use}" for plugin in fault.own if ":" in plugin.use)


POWER = Range(-1e8, 1e8)  # Powers (kW or kvar) that are sent; the plant refuses implausible ones


def load_setting(factor: float | None, P_kW: float | None, Q_kvar: float | None) -> LoadSetting:
    """Return the power of a load, given in kW and kvar at nominal voltage, in the units of messages.

    UsageError if nothing is given, too much, or no number.
    """
    for option, value, allowed in (("--factor", factor, FACTOR), ("--P", P_kW, POWER), ("--Q", Q_kvar, POWER)):
        if value is not None and (objection := allowed.objection(value)):
            raise UsageError(f"{option}: {objection}")
    if factor is not None and (P_kW is not None or Q_kvar is not None):
        raise UsageError("--factor: cannot go with --P or --Q; give the factor or the power")
    if factor is None and P_kW is None and Q_kvar is None:
        raise UsageError("nothing to set; give --factor, or one or both of --P (kW) and --Q (kvar)")
    return LoadSetting(
        factor=factor, P=None if P_kW is None else 1e3 * P_kW, Q=None if Q_kvar is None else 1e3 * Q_kvar
    )


class _LinkReply(msgspec.Struct, frozen=True):
    """The plant's answer to "link"; see `gridpeers.plant.realtime.run_commands`."""

    number: int
    t: float
    asked: tuple[str, ...]
    receivers: tuple[str, ...] = ()


class LinkCommandResult(NamedTuple):
    text: str
    """The effect in words, and its start."""
    acknowledged: list[str]
    absent: list[str]
    """Receivers without an agent; the plant tells the agent when it joins."""
    failures: list[str]
    """Sentences on receivers that refused, or that take part but have not answered in time."""


def links_of_run(client: RunClient) -> EmulationConfig:
    """Return the emulated links of a run; NobodyError if it has none."""
    for config in configurations(client).values():
        if config.links:
            return EmulationConfig.of_tree(config.links)
    raise NobodyError(f"{client.where} has no emulated links; runs of gridpeers plant and gridpeers up have")


def check_link_command(command: LinkCommand, setup: EmulationConfig | None) -> None:
    """Raise UsageError with all problems of a command; without a setup, check only its values."""
    problems: Iterable[Problem] = command.wrong_values() if setup is None else command.problems(setup.microgrids)
    options = [(path.partition(".")[0], text) for path, text in problems]
    wrong = [f"{'LINKS' if option == 'on' else f'--{option}'}: {text}" if option else text for option, text in options]
    if wrong:
        raise UsageError("; ".join(wrong))


def command_links(client: RunClient, command: LinkCommand) -> LinkCommandResult:
    """Give a command and wait until every receiver concerned has taken it, or for `ACKNOWLEDGED` seconds."""

    def agents(answer: Answer) -> set[str]:  # for itself the plant has answered
        reply = data_of(client, answer, _LinkReply)
        return {*reply.receivers} & {*reply.asked}

    answer, answers = request(client, agents, verb="link", link_command=command.to_tree())
    reply = data_of(client, answer, _LinkReply)
    reached = [name for name in reply.receivers if name == PLANT or name in reply.asked]
    silent = [name for name in reached if name != PLANT and name not in answers]
    refused = {name: answers[name].text for name in reached if name in answers and not answers[name].ok}
    failures = [f"{name}: {why}" for name, why in refused.items()]
    if silent:
        failures.append(f"not acknowledged by {', '.join(silent)}; is it frozen? The plant repeats the command")
    return LinkCommandResult(
        text=f"{answer.text}; from t = {reply.t:.2f} s on" if reply.receivers else answer.text,
        acknowledged=[name for name in reached if name not in refused and name not in silent],
        absent=[name for name in reply.receivers if name not in reached],
        failures=failures,
    )
