"""Requests to a running plant: status, configurations, commands to switches, agents and emulated links."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from time import monotonic
from typing import Any, Literal

import msgspec

from agents.agent_config import AgentConfig
from agents.own_nameplate import check_nameplate
from scenarios.emulation.emulation_config import EmulationConfig
from scenarios.emulation.link_command import LinkCommand
from scenarios.emulation.link_reports import LinkStatus, decode_statuses
from scenarios.live.run_address import UsageError
from scenarios.live.run_client import NobodyError, RunClient
from scenarios.live.show.run_monitor import PlantStatus
from scenarios.short_names import in_order
from wire.codec import encode
from wire.messages import PLANT, Answer, Command, LinkAcknowledgement
from wire.table_schema import Problem

Verb = Literal["open", "close", "synchronise", "stop", "down", "status", "link", "links"]

ANSWER = 5.0
"""Longest wait (s) for the answer of a plant that is there."""

ACKNOWLEDGED = 4.0
"""Longest wait (s) for the receivers of a link command; one control period, or a second more if a message was lost."""

HANDOUT = 2.0
"""Longest wait (s) for a configuration that the plant hands out; it answers within milliseconds."""

AGAIN = 0.1
"""Time (s) between two requests for the same thing."""

LEAVING = 10.0
"""Longest wait (s) for processes that were asked to leave."""


class RefusedError(ValueError):
    """The plant has refused a command; the message is the plant's."""


def ask(client: RunClient, verb: Verb, argument: str = "") -> str:
    """Give the plant a command and return its answer.

    Raises
    ------
    RefusedError
        If the plant refuses.
    NobodyError
        If it does not answer.
    """
    answer, _ = _request(client, lambda text: set(), verb=verb, argument=argument)
    return answer


def _request(
    client: RunClient, receivers: Callable[[str], set[str]], **command_fields: Any
) -> tuple[str, dict[str, LinkAcknowledgement]]:
    """Return the plant's answer, and the answers that come in time of the receivers that follow from it."""
    command = Command(sender="visitor", epoch=0, seq=0, t=0.0, reply_to=client.id, **command_fields)
    client.publish(client.keys.command, encode(command))
    text: str | None = None
    answers: dict[str, LinkAcknowledgement] = {}
    end = monotonic() + ANSWER
    while (left := end - monotonic()) > 0.0:
        for key, payload, _ in client.take(left):
            message = client.read(key, payload)
            if isinstance(message, LinkAcknowledgement):
                answers[message.sender] = message
            elif isinstance(message, Answer):
                if not message.ok:
                    raise RefusedError(message.text)
                text, end = message.text, monotonic() + ACKNOWLEDGED
        if text is not None and answers.keys() >= receivers(text):
            break
    if text is None:
        raise NobodyError(
            f"the plant of {client.where} is there but has not answered within {ANSWER:g} s; is it frozen?"
        )
    return text, answers


def plant_status(client: RunClient) -> PlantStatus:
    """Return the state of the run as the plant reports it."""
    return msgspec.json.decode(ask(client, "status"), type=PlantStatus)


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
        there = f"inverters are {', '.join(in_order(known))}" if known else "the plant names none"
        raise NobodyError(f'no inverter "{name}" in {client.where}; {there}')
    return known[name]


def configurations(client: RunClient, name: str = "") -> dict[str, AgentConfig]:
    """Return configurations of agents by name: all that came until that of `name`, or any, was there."""
    known: dict[str, AgentConfig] = {}
    client.fetch(client.keys.config("*"))
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
            f"(gridpeers stop {name}), or start the agent of another inverter"
        )


# ---- emulated links


class _LinkReply(msgspec.Struct, frozen=True):
    """The plant's answer to "link" and "links"; see `plant.realtime.run_commands`."""

    number: int
    t: float
    asked: tuple[str, ...]
    said: str = ""
    receivers: tuple[str, ...] = ()

    @property
    def reached(self) -> tuple[str, ...]:
        """Receivers of a command that take part: the plant, and the agents that it has sent the command."""
        return tuple(name for name in self.receivers if name == PLANT or name in self.asked)

    @property
    def answers_needed(self) -> set[str]:
        """Receivers that answer: agents to a command, for which the plant has answered; the plant too to "links"."""
        return {*self.reached} - {PLANT} if self.number > 0 else {*self.asked, PLANT}


@dataclass(frozen=True, kw_only=True)
class LinkCommandResult:
    """The receivers' answers to a link command."""

    t: float
    """Run time (s) from which on it holds."""
    text: str
    """Its effect in words: a heal names only links that had a fault."""
    acknowledged: tuple[str, ...]
    """Receivers that have taken it."""
    silent: tuple[str, ...]
    """Receivers that take part and have not answered in time."""
    absent: tuple[str, ...]
    """Receivers without an agent: the plant tells the agent when it comes."""
    refused: Mapping[str, str]
    """Receivers that have refused, and why."""

    @property
    def changes_links(self) -> bool:
        """Whether it changes any link."""
        return bool(self.acknowledged or self.silent or self.absent or self.refused)


def links_of_run(client: RunClient) -> tuple[EmulationConfig, AgentConfig]:
    """Return the emulated links of a run, and the configuration of one of its agents.

    Raises
    ------
    NobodyError
        If the run has no links that can be changed.
    """
    for config in configurations(client).values():
        if config.links:
            return EmulationConfig.of_tree(config.links), config
    raise NobodyError(
        f"{client.where} has no emulated links that could be changed; runs started by gridpeers plant or up have"
    )


def check_link_command(command: LinkCommand, setup: EmulationConfig | None) -> None:
    """Raise UsageError with all that is wrong with a command; without a setup, with its values alone."""
    problems: Iterable[Problem] = command.wrong_values() if setup is None else command.problems(setup.microgrids)
    options = [(path.partition(".")[0], text) for path, text in problems]
    wrong = [f"{'LINKS' if option == 'on' else f'--{option}'}: {text}" if option else text for option, text in options]
    if wrong:
        raise UsageError("; ".join(wrong))


def command_links(client: RunClient, command: LinkCommand) -> LinkCommandResult:
    """Give a command and wait until every receiver concerned has taken it, or for `ACKNOWLEDGED` seconds."""
    reply, answers = _request_links(client, verb="link", link_command=command.to_tree())
    refused = {name: answers[name].text for name in reply.reached if name in answers and not answers[name].ok}
    silent = tuple(name for name in reply.reached if name != PLANT and name not in answers)
    return LinkCommandResult(
        t=reply.t,
        text=reply.said,
        acknowledged=tuple(name for name in reply.reached if name not in refused and name not in silent),
        silent=silent,
        absent=tuple(name for name in reply.receivers if name not in reply.reached),
        refused=refused,
    )


def link_states(client: RunClient) -> tuple[float, dict[tuple[str, str], LinkStatus], tuple[str, ...]]:
    """Return the run time (s), the state of every link that has or had a fault, and the receivers without an answer."""
    reply, answers = _request_links(client, verb="links")
    found: dict[tuple[str, str], LinkStatus] = {}
    for name, answer in answers.items():
        if answer.ok:
            try:
                of_sender: dict[str, LinkStatus] = decode_statuses(answer.data)
            except msgspec.DecodeError:  # counts as no answer
                continue
            found |= {(src, name): state for src, state in of_sender.items()}
    return reply.t, found, tuple(name for name in reply.asked if name not in answers)


def _request_links(client: RunClient, **command_fields: Any) -> tuple[_LinkReply, dict[str, LinkAcknowledgement]]:
    text, answers = _request(client, lambda text: _link_reply(text).answers_needed, **command_fields)
    return _link_reply(text), answers


def _link_reply(text: str) -> _LinkReply:
    return msgspec.json.decode(text, type=_LinkReply)
