from __future__ import annotations

import socket
import struct
import sys
from time import monotonic

import pytest

from gridpeers.scenarios.drivers.free_endpoint import free_endpoint
from gridpeers.wire.driver.session import Session, SessionError, do_not_linger


def test_a_port_in_use_is_explained() -> None:
    """The second session on an endpoint gets an error with the endpoint and a remedy."""
    endpoint = free_endpoint()
    first = Session("plant", listen=(endpoint,))
    try:
        with pytest.raises(SessionError, match=r"plant: cannot listen on tcp/127.* the port is in use; choose another"):
            Session("plant", listen=(endpoint,))
    finally:
        first.close()


def test_a_missing_zenoh_is_explained(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever installed without Zenoh is told the package's name and the driver that needs none."""
    monkeypatch.setitem(sys.modules, "zenoh", None)

    with pytest.raises(SessionError, match=r"inv1: eclipse-zenoh is not installed; .*; or use --driver inprocess"):
        Session("inv1")


def test_a_subscription_proven_by_a_query_is_in_place() -> None:
    """Once a neighbour has answered after the subscription, its next publication arrives: discovery relies on it."""
    for _ in range(20):
        endpoint = free_endpoint()
        sender, receiver = Session("a", listen=(endpoint,)), Session("b", connect=(endpoint,))
        try:
            sender.answer("gridpeers/t/nameplate", b"me")
            sender.hold_token(f"gridpeers/t/alive/{'a' * 2_000}")  # as no process of a run does
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
    """The next event, which must come within a minute."""
    until, events = monotonic() + 60.0, []
    while not events:
        assert monotonic() < until, "nothing came"
        events = session.inbox.take(1, until - monotonic())
    ((kind, key, payload, _),) = events
    return kind, key, payload


def test_only_in_real_time_a_link_may_be_given_up_early_and_newest_values_dropped() -> None:
    """Lock-step drops nothing and waits Zenoh's 5 s; real time drops stale values and waits 200 ms."""
    found = {}
    for clock in ("simulated", "realtime"):
        session = Session("a", listen=("tcp/127.0.0.1:0",), clock=clock)
        try:
            keys = ("gridpeers/t/state/inv1", "gridpeers/t/telemetry")
            wait = session.setting("transport/link/tx/queue/congestion_control/block/wait_before_close")
            found[clock] = wait, [session.may_drop(key) for key in keys]
        finally:
            session.close()

    assert found == {"simulated": (5_000_000, [False, False]), "realtime": (200_000, [True, False])}


def lingers(connection: socket.socket) -> bool:
    return struct.unpack("ii", connection.getsockopt(socket.SOL_SOCKET, socket.SO_LINGER, 8))[0] != 0


def test_links_close_at_once_and_stay_open_until_then() -> None:
    """SO_LINGER goes from a connection that has it; what is sent over it still arrives."""
    with socket.create_server(("127.0.0.1", 0)) as server, socket.create_connection(server.getsockname()) as link:
        accepted, _ = server.accept()
        with accepted:
            link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 10))
            assert lingers(link)

            do_not_linger()
            assert not lingers(link)

            link.sendall(b"state")
            assert accepted.recv(5) == b"state"
