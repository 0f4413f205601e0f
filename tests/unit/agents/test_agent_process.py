"""The sessions of a process of agents: broken ones, refused ones, and requests to end at any time."""

from __future__ import annotations

import logging
from collections.abc import Callable
from time import monotonic
from typing import Any, cast

import pytest
from msgspec.structs import replace

from gridpeers.agents import agent_process
from gridpeers.agents.agent_node import AgentNode
from gridpeers.agents.agent_process import _opened, take_part
from gridpeers.wire.codec import encode
from gridpeers.wire.driver.drive import StoppedError
from gridpeers.wire.driver.inbox import Inbox, Stamped
from gridpeers.wire.driver.session import Session, SessionError
from gridpeers.wire.keys import Keys
from gridpeers.wire.messages import Stop
from tests.toy.toy_configs import agent_config

KEYS = Keys("toy")
PLANT_TOKEN = KEYS.alive_plant(1)
LEAVE = KEYS.leave("inv1")


class Played:
    """A session whose events the test plays."""

    def __init__(self, *events: Stamped | BaseException) -> None:
        self._events = list(events)
        self.inbox = Inbox()
        self.left = 0
        """How often the plant was told that the agent leaves."""
        self._plant_is_there = True

    def __getattr__(self, name: str) -> Callable[..., Any]:
        return lambda *words: ()

    def take(self, needed: int, timeout: float | None) -> list[Stamped]:
        event = self._events.pop(0) if self._events else ("word", "over", b"", monotonic())
        if isinstance(event, BaseException):
            raise event
        self._plant_is_there &= event[0] != "vanished"
        return [event]

    def publish(self, key: str, payload: bytes) -> None:
        if key == LEAVE and self._plant_is_there:
            self.left += 1
            stop = encode(Stop(sender="plant", epoch=1, seq=0, t=0.0, reason="it has left"))
            self._events.insert(0, ("message", KEYS.stop_request("inv1", "me"), stop, monotonic()))


def ended(*events: Stamped | BaseException) -> Played:
    agent = AgentNode(replace(agent_config("inv1"), clock="realtime"), "me")
    session = Played(("appeared", PLANT_TOKEN, b"", monotonic()), *events)
    with pytest.raises(StoppedError):
        take_part(agent, (agent,), cast(Session, session), logging.getLogger("test"))
    assert agent.finished
    return session


def test_an_agent_that_is_asked_to_end_leaves() -> None:
    """The plant takes its inverter off the network; an agent without a plant just ends."""
    assert ended(StoppedError("SIGTERM")).left == 1
    assert ended(("vanished", PLANT_TOKEN, b"", monotonic()), StoppedError("SIGTERM")).left == 0


def test_a_session_in_place_of_a_broken_one_is_tried_again(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Keys that are being copied, or a lack of files, cost time and not the agent; the first session fails at once."""
    clock, opened, session = [0.0], list[float](), object()

    def refusing(name: str, **words: Any) -> object:
        opened.append(clock[0])
        if len(opened) < 4:
            raise SessionError(f"{name}: no key")
        return session

    monkeypatch.setattr(agent_process, "monotonic", lambda: clock[0])
    monkeypatch.setattr(agent_process, "sleep", lambda s: clock.__setitem__(0, clock[0] + s))
    monkeypatch.setattr(agent_process, "Session", refusing)

    assert _opened(agent_config("inv1"), None, again=True) is session
    assert {record.getMessage() for record in caplog.records} == {"inv1: no key; tries again for up to 60 s"}
    opened.clear()
    with pytest.raises(SessionError, match="inv1: no key"):
        _opened(agent_config("inv1"), None, again=False)
    assert len(opened) == 1
