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
from contextlib import suppress
from pathlib import Path

_OFF = struct.pack("ii", 0, 0)


def do_not_linger() -> None:
    """Switch SO_LINGER off on this process's TCP sockets; where a process cannot list its open files, do nothing."""
    with suppress(OSError):
        for entry in Path("/dev/fd").iterdir():
            with suppress(OSError):  # closed in the meantime
                _switch_off(int(entry.name))


def _switch_off(fd: int) -> None:
    if not stat.S_ISSOCK(os.fstat(fd).st_mode):
        return
    with socket.socket(fileno=os.dup(fd)) as same:
        if same.type != socket.SOCK_STREAM or same.family not in (socket.AF_INET, socket.AF_INET6):
            return
        on, _ = struct.unpack("ii", same.getsockopt(socket.SOL_SOCKET, socket.SO_LINGER, len(_OFF)))
        if on:
            same.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _OFF)
