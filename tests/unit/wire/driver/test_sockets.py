"""The host's addresses as they are now, sockets that close at once, and links that a closed session leaves."""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from gridpeers.wire.driver.sockets import (
    LinkAddresses,
    do_not_linger,
    end_left_links,
    host_addresses,
)

OLD, NEW, OTHER = "10.9.0.2", "10.9.0.77", "10.8.0.1"
ANY = ("tcp/0.0.0.0:0",)


@pytest.mark.skipif(not Path("/proc/net/fib_trie").exists(), reason="this system lists no addresses in /proc")
def test_the_addresses_of_this_host_reach_others() -> None:
    """None is loopback; two looks see the same."""
    assert not any(text.startswith("127.") or text == "::1" for text in host_addresses())
    assert host_addresses() == host_addresses()


def test_a_system_that_lists_nothing_has_no_addresses() -> None:
    """Then a session listens as it is asked to, and stays."""
    known = LinkAddresses(ANY, ())
    assert (known.endpoints, known.moved({OLD}, ())) == (ANY, False)


@pytest.mark.parametrize(
    ("opened", "sources", "now", "moved"),
    [
        ({OLD}, {OLD}, {OLD}, False),
        ({OLD}, {OLD}, {NEW}, True),  # by DHCP
        ({OLD}, {OLD}, set(), False),  # the cable is out: nothing to be gained
        ({OLD, OTHER}, {OLD}, {OLD}, False),  # a network goes that no link uses
        ({OLD}, {OLD}, {OLD, OTHER}, False),  # one comes
        ({OLD}, set(), {NEW}, False),  # no link yet: nobody has been told anything
    ],
)
def test_a_session_is_given_up_once_its_links_have_lost_their_address(
    opened: set[str], sources: set[str], now: set[str], *, moved: bool
) -> None:
    """An address of a link is gone, and there is another one."""
    known = LinkAddresses(ANY, opened)
    assert not known.moved(sources, opened)
    assert known.moved(sources, now) is moved


ZENOH = struct.pack("ii", 1, 10)


@pytest.fixture
def pair() -> Iterator[tuple[socket.socket, socket.socket]]:
    with ExitStack() as stack:
        server = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
        link = stack.enter_context(socket.create_connection(server.getsockname()))
        other = stack.enter_context(server.accept()[0])
        other.settimeout(10.0)
        yield link, other


def test_a_link_of_zenoh_is_ended_though_it_lingers_no_more(pair: tuple[socket.socket, socket.socket]) -> None:
    """The other side reads its end."""
    link, other = pair
    link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, ZENOH)
    do_not_linger()

    end_left_links()

    assert other.recv(1) == b""


def test_a_connection_that_is_not_zenohs_stays(pair: tuple[socket.socket, socket.socket]) -> None:
    """A law of the user's may have its own."""
    link, other = pair

    end_left_links()
    link.sendall(b"x")

    assert other.recv(1) == b"x"


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
