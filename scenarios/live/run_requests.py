"""Commands to a running plant and their answers: status, stop, event, down."""

from __future__ import annotations

from time import monotonic
from typing import Literal

import msgspec

from agents.agent_config import AgentConfig
from agents.own_nameplate import check_nameplate
from scenarios.live.run_client import NobodyError, RunClient
from scenarios.live.show.run_monitor import PlantStatus, RunMonitor
from scenarios.live.show.snapshot import Snapshot
from scenarios.short_names import in_order
from wire.codec import encode
from wire.messages import PLANT, AgentStatus, Answer, Command, Telemetry
from wire.session_patience import SessionPatience

Verb = Literal["open", "close", "synchronise", "stop", "down", "status", "link", "links"]

ANSWER = 5.0
"""Longest wait (s) for the answer of a plant that is there."""

PLATES = 2.0
"""Longest wait (s) for a configuration that the plant hands out; it answers within milliseconds."""

AGAIN = 0.1
"""Time (s) between two questions about the same thing."""

LOOK = 1.2
"""Longest wait (s) for one look: two periods of an agent's status, and a bit."""

SILENT = 1.0
"""Time (s) without a word after which somebody counts as silent: two periods of an agent's status."""

LEAVING = 10.0
"""Longest wait (s) for those who were told to leave."""


class RefusedError(ValueError):
    """The plant has said no; the message is its."""


def ask(client: RunClient, verb: Verb, argument: str = "") -> str:
    """Give the plant a command; what it answers.

    Raises
    ------
    RefusedError
        If it says no.
    NobodyError
        If it does not answer.
    """
    command = Command(sender="visitor", incarnation=0, seq=0, t=0.0, verb=verb, argument=argument, reply_to=client.id)
    client.publish(client.keys.command, encode(command))
    end = monotonic() + ANSWER
    while (left := end - monotonic()) > 0.0:
        for key, payload in client.take(left):
            answer = client.read(key, payload)
            if isinstance(answer, Answer):
                if not answer.ok:
                    raise RefusedError(answer.text)
                return answer.text
    raise NobodyError(f"the plant of {client.where} is there but has not answered within {ANSWER:g} s; is it frozen?")


def standing(client: RunClient) -> PlantStatus:
    """How the plant says the run stands."""
    return msgspec.json.decode(ask(client, "status"), type=PlantStatus)


def configuration(client: RunClient, name: str) -> AgentConfig:
    """What the plant hands to the agent of an inverter.

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
    """What the plant hands to agents, by name: of all those that came until that of `name`, or any, was there."""
    known: dict[str, AgentConfig] = {}
    client.fetch(client.keys.config("*"))
    end = monotonic() + PLATES
    while not (name in known if name else known) and (left := end - monotonic()) > 0.0:
        for _, payload in client.take(left):
            config = _plate(payload)
            if config is not None:
                known[config.name] = config
    return known


def check_free(client: RunClient, name: str) -> None:
    """Raise NobodyError if an agent of this name takes part already, before a second one says anything in the run.

    Of two that come at the same moment the plant refuses one.
    """
    if name in standing(client).agents:
        raise NobodyError(
            f"{name}: another agent of this name takes part in run {client.where.run} already; stop it first "
            f"(gridpeers stop {name}), or start the agent of another inverter"
        )


def look(client: RunClient) -> Snapshot:
    """Listen until the plant and every agent have told how they are, or for `LOOK` seconds."""
    monitor, heard = RunMonitor(client.where.run), set[str]()
    monitor.standing(standing(client))
    watch = Watching(client, monitor)
    told = False
    end = monotonic() + LOOK
    while (left := end - monotonic()) > 0.0:
        for message in watch.take(left):
            told = told or isinstance(message, Telemetry)
            if isinstance(message, AgentStatus):
                heard.add(message.sender)
        if told and heard >= set(present(client)) and monitor.has_plates:
            break
    return monitor.look(present(client), monotonic())


def present(client: RunClient) -> list[str]:
    """Inverters whose agents have a token."""
    return [name for name, instances in client.agents.items() if instances]


class Watching:
    """Brings what a run tells into a monitor.

    Parameters
    ----------
    client : RunClient
        At the run.
    monitor : RunMonitor
        Takes it.
    """

    def __init__(self, client: RunClient, monitor: RunMonitor) -> None:
        self._visit, self._picture = client, monitor
        self._subscribed: set[str] = set()
        self._plant = client.plant
        self._told: dict[str, float] = {}
        """When who last told anything."""
        self._used: dict[str, tuple[str, ...]] = {}
        """Whom each agent has in its sums."""
        self._patience = SessionPatience()
        client.listen(client.keys.telemetry)
        client.fetch(client.keys.config("*"))

    def take(self, seconds: float) -> list[Telemetry | AgentStatus]:
        """Wait (s) for something to happen and note it; what was told."""
        told: list[Telemetry | AgentStatus] = []
        for key, payload in self._visit.take(seconds):
            config = _plate(payload)
            if config is not None:
                self._picture.plate(config)
                continue
            message = self._visit.read(key, payload)
            if isinstance(message, Telemetry):
                self._picture.telemetry(message, monotonic())
                told.append(message)
                self._told[PLANT] = monotonic()
            elif isinstance(message, AgentStatus):
                self._picture.status(message, monotonic())
                told.append(message)
                self._told[message.sender] = monotonic()
                self._used[message.sender] = message.used
        if self._visit.plant and not self._plant:  # it was restarted, perhaps with other inverters
            self._visit.fetch(self._visit.keys.config("*"))
        self._plant = self._visit.plant
        for name in {*self._picture.inverters, *self._visit.agents} - self._subscribed:
            self._subscribed.add(name)
            self._visit.listen(self._visit.keys.status(name))
        self._renew(monotonic())
        return told

    def _renew(self, now: float) -> None:
        """Come again if somebody who is there has told nothing for too long: the session has gone astray.

        There is whose token is there, and whom somebody who tells has in its sums.
        """
        telling = {name for name, at in self._told.items() if now - at <= SILENT}
        there = {*([PLANT] if self._visit.plant else []), *present(self._visit)}
        there.update(*(self._used.get(name, ()) for name in telling))
        silent = sorted(there - telling)
        self._patience.whole |= PLANT in telling and not silent
        if self._patience.lost(silent, now):
            self._patience = self._patience.next()
            self._visit.renew()


def _plate(payload: bytes) -> AgentConfig | None:
    if not payload.startswith(b"{"):
        return None
    try:
        config = msgspec.json.decode(payload, type=AgentConfig)
        check_nameplate(config)
    except (msgspec.DecodeError, ValueError):
        return None
    return config


def has_left(client: RunClient, name: str) -> bool:
    """Wait until an agent that was told to leave has left; whether it has."""
    end = monotonic() + LEAVING
    while name in standing(client).agents:
        if monotonic() > end:
            return False
        client.until(lambda: False, AGAIN)
    return True


def has_ended(client: RunClient) -> bool:
    """Wait until a run that was told to end has ended; whether it has. The plant goes when all others have."""
    return client.until(lambda: not client.plant, LEAVING)
