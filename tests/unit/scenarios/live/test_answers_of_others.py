"""Answers that somebody else has asked for in a client's name: they do not count as answers to its own command."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from gridpeers.scenarios.live.link_requests import link_states
from gridpeers.scenarios.live.run_client import NobodyError
from gridpeers.scenarios.live.run_requests import plant_status, request
from gridpeers.wire.codec import decode
from gridpeers.wire.keys import Keys
from gridpeers.wire.messages import Answer, AnyMessage, Command, LinkAcknowledgement


class Client:
    """Stands for a client at a plant: before each true answer come those to a viewer's questions in its name."""

    id, where, keys = "z1", "run demo", Keys("demo")

    def __init__(self, **data: Any) -> None:
        self._data = {"number": 3, "t": 2.0, "asked": ["inv2"], "receivers": ["inv2"]} | data
        self.numbers: list[int] = []
        self._waiting: list[AnyMessage] = []

    def publish(self, key: str, payload: bytes) -> None:
        """Take a command, and answer it after others."""
        command = decode(payload)
        assert isinstance(command, Command)
        self.numbers.append(command.seq)
        common: dict[str, Any] = {"epoch": 1, "t": 2.0}
        for number in (0, 1):
            self._waiting += [
                Answer(sender="plant", seq=number, ok=False, text="lie", data={}, **common),
                LinkAcknowledgement(sender="inv2", seq=0, ok=True, text="lie", reply_to=self.id, **common),
            ]
        self._waiting += [
            Answer(sender="plant", seq=command.seq, ok=True, text="true", data=self._data, **common),
            LinkAcknowledgement(sender="inv2", seq=2, ok=True, text="old", reply_to=self.id, **common),
            LinkAcknowledgement(sender="inv2", seq=3, ok=False, text="true", reply_to=self.id, **common),
        ]

    def take(self, seconds: float) -> Iterator[tuple[str, bytes, float]]:
        """Yield one message at a time, as they come."""
        if self._waiting:
            yield "", b"", 0.0

    def read(self, key: str, payload: bytes) -> AnyMessage:
        """Return the next message."""
        return self._waiting.pop(0)


def test_only_the_answer_to_the_own_command_counts() -> None:
    """By its number, which nobody else knows; and only acknowledgements of the number that this answer names."""
    client = Client()

    answer, acknowledgements = request(client, lambda answer: {"inv2"}, verb="link", link_command={})  # type: ignore[arg-type]

    assert (answer.text, [each.text for each in acknowledgements.values()]) == ("true", ["true"])


def test_numbers_of_commands_cannot_be_foreseen() -> None:
    """Of twenty no two are the same, and they have no order."""
    client = Client()
    for _ in range(20):
        request(client, lambda answer: set(), verb="status")  # type: ignore[arg-type]

    assert len({*client.numbers}) == 20
    assert client.numbers != sorted(client.numbers)


def test_an_answer_of_another_form_is_told_in_one_line() -> None:
    """Of a plant of another version, or of whoever speaks as one on open links: nothing else is raised."""
    with pytest.raises(NobodyError, match=r"run demo answers what cannot be read here: .* `phase`; is it of another"):
        plant_status(Client())  # type: ignore[arg-type]
    with pytest.raises(NobodyError, match=r"Expected `int`, got `bool` - at `\$.number`; is it of another version"):
        link_states(Client(number=True))  # type: ignore[arg-type]
