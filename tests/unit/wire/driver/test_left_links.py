"""Zenoh's sockets close at once, and links that a closed session leaves are ended."""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterator
from contextlib import ExitStack
from threading import Timer

import pytest

from gridpeers.wire.driver.left_links import QUIET, do_not_linger, end_left_links

ZENOH = struct.pack("ii", 1, 10)


@pytest.fixture
def pair() -> Iterator[tuple[socket.socket, socket.socket]]:
    """Both ends of a connection."""
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


def test_a_link_that_comes_later_is_ended_too(pair: tuple[socket.socket, socket.socket]) -> None:
    """Zenoh finishes links that it was just making after its session is closed."""
    link, other = pair
    later = Timer(QUIET / 3, link.setsockopt, (socket.SOL_SOCKET, socket.SO_LINGER, ZENOH))
    later.start()

    end_left_links()
    later.join()

    assert other.recv(1) == b""


def test_a_connection_that_is_not_zenohs_stays(pair: tuple[socket.socket, socket.socket]) -> None:
    """A law of the user's may have its own."""
    link, other = pair

    end_left_links()
    link.sendall(b"x")

    assert other.recv(1) == b"x"


def lingers(connection: socket.socket) -> bool:
    """Whether closing it may block."""
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
