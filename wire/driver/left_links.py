"""Zenoh's sockets that would block a thread at their end, or outlive their session.

Zenoh sets SO_LINGER to 10 s on every TCP socket, and no setting turns it off. Closing a socket with a dead path then
blocks its thread, which serves all other links too, for that time. Without it the kernel closes in the background, and
still delivers the sent data.

While Zenoh closes a session, links that are just being made still come about, up to 50 ms later. Nobody closes these:
each keeps a file and 0.1 MB until the process at its other end closes too, and that takes it for a living peer.
"""

from __future__ import annotations

import os
import socket
import stat
import struct
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from time import monotonic, sleep

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


EVERY = 0.01
"""Time (s) between two looks for such links."""

QUIET = 0.05
"""Time (s) without such a link after which none comes any more; on a busy machine the longest was 20 ms."""

LONGEST = 1.0
"""Longest search (s): somebody may connect again and again."""


def end_left_links() -> None:
    """End all of Zenoh's links in this process, and those that come in the next `QUIET` seconds.

    Zenoh is left to close them: it reads their end, as if the other side had closed.
    """
    end = monotonic() + LONGEST
    quiet = monotonic() + QUIET
    while monotonic() < min(quiet, end):
        if _end_links():
            quiet = monotonic() + QUIET
        sleep(EVERY)


def _end_links() -> bool:
    """End the links that are there; return whether there were any."""
    ended = False
    for same in tcp_sockets():
        with suppress(OSError):  # ended by the other side
            _, seconds = linger(same)
            if seconds == ZENOH_LINGERS:
                same.shutdown(socket.SHUT_RDWR)
                ended = True
    return ended
