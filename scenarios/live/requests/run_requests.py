"""Requests to a running plant: its status, and commands to switches and agents."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Mapping
from math import inf
from time import monotonic
from typing import Any, Literal, TypeVar

import msgspec

from gridpeers.scenarios.live.client.run_client import NobodyError, RunClient
from gridpeers.scenarios.live.requests.plant_status import PlantStatus
from gridpeers.wire.bounds import MOST_COUNT
from gridpeers.wire.codec import encode
from gridpeers.wire.messages import Answer, Command, LinkAcknowledgement, LoadSetting
from gridpeers.wire.printable import printable

T = TypeVar("T")

Verb = Literal["open", "close", "synchronise", "load", "stop", "down", "status", "link", "links"]

QUESTIONS = ("status", "links")
"""Verbs that change nothing."""

ANSWER = 10.0
"""Longest wait (s) for the answer of a plant that is there; on a busy machine it may take a second."""

ASKED_AGAIN = 1.0
"""Time (s) after which a question without an answer is asked again: it may have been lost with its link."""

ACKNOWLEDGED = 4.0
"""Longest wait (s) for the receivers of a link command; one control period, or a second more if a message was lost."""

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
    client: RunClient,
    receivers: Callable[[Answer], set[str]],
    *,
    verb: Verb,
    wait: float = ANSWER,
    **command_fields: Any,
) -> tuple[Answer, dict[str, LinkAcknowledgement]]:
    """Give the plant a command; return its answer, and those that come in time of the receivers that follow from it.

    Anybody who may ask the plant anything may have its answer sent to this client. So the command has a number that
    nobody else knows, which the plant repeats; acknowledgements have the number that the plant's answer names.

    A question, which changes nothing, is asked again until its answer comes, for `wait` (s).
    """
    number = secrets.randbelow(MOST_COUNT)
    command = Command(sender="visitor", epoch=0, seq=number, t=0.0, reply_to=client.id, verb=verb, **command_fields)
    answer: Answer | None = None
    acknowledgements: dict[int, dict[str, LinkAcknowledgement]] = {}
    now = ask_at = monotonic()
    end = now + wait
    while now < end:
        if now >= ask_at:
            client.publish(client.keys.for_verb(verb), encode(command))
            ask_at = now + ASKED_AGAIN if verb in QUESTIONS else inf
        for key, payload, _ in client.take(min(end, ask_at) - now):
            message = client.read(key, payload)
            if isinstance(message, LinkAcknowledgement):
                acknowledgements.setdefault(message.seq, {})[message.sender] = message
            elif isinstance(message, Answer) and message.seq == number:
                if not message.ok:
                    raise RefusedError(message.text)
                answer, end, ask_at = message, monotonic() + ACKNOWLEDGED, inf
        if answer is not None and _of_number(answer, acknowledgements).keys() >= receivers(answer):
            break
        now = monotonic()
    if answer is None:
        raise NobodyError(
            f"the plant of {client.where} is there but has not answered within {wait:.3g} s; is it frozen?"
        )
    return answer, _of_number(answer, acknowledgements)


def _of_number(
    answer: Answer, acknowledgements: Mapping[int, dict[str, LinkAcknowledgement]]
) -> dict[str, LinkAcknowledgement]:
    """Return the acknowledgements of the number that an answer names."""
    number = answer.data.get("number")
    return acknowledgements.get(number, {}) if isinstance(number, int) else {}


def plant_status(client: RunClient, wait: float = ANSWER) -> PlantStatus:
    """Return the state of the run as the plant reports it within `wait` (s)."""
    answer, _ = request(client, lambda answer: set(), verb="status", wait=wait)
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
