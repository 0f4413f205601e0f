"""Make Zenoh's sockets close at once.

Zenoh sets SO_LINGER to 10 s on every TCP socket. Closing a socket with a dead path then blocks its thread for
that time, or until the path is healed; and that thread serves all other links too. So when one host was cut off, the
agents of all others heard nothing for up to 10 s a link, and after a heal Zenoh added links to transports that were
still closing. No setting of Zenoh turns it off. Without it the kernel closes in the background, and still
delivers the sent data.
"""

from __future__ import annotations

import os
import socket
import stat
import struct
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

ZENOH_LINGERS = 10
"""Zenoh's time (s). The kernel keeps it after the option is off, so it tells Zenoh's sockets from others."""

_OFF = struct.pack("ii", 0, 0)


def do_not_linger() -> None:
    """Switch SO_LINGER off on this process's TCP sockets; where a process cannot list its open files, do nothing."""
    for same in tcp_sockets():
        with suppress(OSError):  # closed in the meantime
            on, _ = linger(same)
            if on:
                same.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _OFF)


def linger(connection: socket.socket) -> tuple[int, int]:
    """Return whether closing a socket may block, and for how long (s)."""
    on, seconds = struct.unpack("ii", connection.getsockopt(socket.SOL_SOCKET, socket.SO_LINGER, len(_OFF)))
    return on, seconds


def tcp_sockets() -> Iterator[socket.socket]:
    """Yield a copy of each TCP socket of this process, open until the next; none where it cannot list its files."""
    with suppress(OSError):
        for entry in Path("/dev/fd").iterdir():
            with suppress(OSError):  # closed in the meantime
                fd = int(entry.name)
                if not stat.S_ISSOCK(os.fstat(fd).st_mode):
                    continue
                with socket.socket(fileno=os.dup(fd)) as same:
                    if same.type == socket.SOCK_STREAM and same.family in (socket.AF_INET, socket.AF_INET6):
                        yield same
