"""End the links that a closed Zenoh session leaves.

While Zenoh closes a session, links that are just being made still come about, up to 50 ms later. Nobody closes these:
each keeps a file and 0.1 MB until the process at its other end closes too, and that takes it for a living peer.
"""

from __future__ import annotations

import socket
from contextlib import suppress
from time import monotonic, sleep

from gridpeers.wire.driver.lingering import ZENOH_LINGERS, linger, tcp_sockets

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
