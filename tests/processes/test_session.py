from __future__ import annotations

import sys
from time import monotonic

import pytest

from scenarios.drivers.rendezvous import rendezvous
from wire.driver.session import Session, SessionError


def test_a_port_in_use_is_explained() -> None:
    """Who listens second is told which endpoint, and what to do."""
    endpoint = rendezvous()
    first = Session("plant", listen=(endpoint,))
    try:
        with pytest.raises(SessionError, match=r"plant: cannot listen on tcp/127.* the port is in use; choose another"):
            Session("plant", listen=(endpoint,))
    finally:
        first.close()


def test_a_missing_zenoh_is_explained(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever installed without Zenoh is told the package's name and the driver that needs none."""
    monkeypatch.setitem(sys.modules, "zenoh", None)

    with pytest.raises(SessionError, match=r"inv1: the package eclipse-zenoh is missing .* or use --driver inprocess"):
        Session("inv1")


def test_a_subscription_proven_by_a_query_is_in_place() -> None:
    """What discovery relies on: once a neighbour has answered after the subscription, its next publication arrives."""
    for _ in range(20):
        endpoint = rendezvous()
        sender, receiver = Session("a", listen=(endpoint,)), Session("b", connect=(endpoint,))
        try:
            sender.answer("gridpeers/t/nameplate", b"me")
            sender.hold_token("gridpeers/t/alive/a")
            receiver.watch("gridpeers/t/alive/**")
            assert take_one(receiver) == ("appeared", "gridpeers/t/alive/a", b"")
            receiver.subscribe("gridpeers/t/state")
            receiver.fetch("gridpeers/t/nameplate")
            assert take_one(receiver) == ("message", "gridpeers/t/nameplate", b"me")
            sender.publish("gridpeers/t/state", b"first")
            assert take_one(receiver) == ("message", "gridpeers/t/state", b"first")
        finally:
            receiver.close()
            sender.close()


def take_one(session: Session) -> tuple[str, str, bytes]:
    """The next event, which must come within 5 s."""
    until, events = monotonic() + 5.0, []
    while not events:
        assert monotonic() < until, "nothing came"
        events = session.inbox.take(1, until - monotonic())
    ((kind, key, payload, _),) = events
    return kind, key, payload
