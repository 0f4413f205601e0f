from __future__ import annotations

import socket
import struct

from gridpeers.wire.driver.lingering import do_not_linger


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
