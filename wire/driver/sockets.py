"""The host's addresses, which Zenoh lists only once, and sockets that Zenoh leaves or closes too slowly.

Zenoh lists the addresses once in a process. After a change it would give others the old ones, in a new session too.

Zenoh sets SO_LINGER to 10 s on every TCP socket, and no setting turns it off. Closing a socket with a dead path then
blocks its thread, which serves all other links too, for that time. Without it the kernel closes in the background, and
still delivers the sent data.

While Zenoh closes a session, links that are just being made still come about, up to 50 ms later. Nobody closes these:
each keeps a file and 0.1 MB until the process at its other end closes too, and that takes it for a living peer.
"""

from __future__ import annotations

import os
import re
import socket
import stat
import struct
from collections.abc import Collection, Iterator
from contextlib import suppress
from ipaddress import IPv6Address, ip_address
from pathlib import Path
from time import monotonic, sleep

_UNUSABLE = 0x48
"""Flags of an IPv6 address that is not used yet, or is another host's: tentative, and dadfailed."""


def host_addresses() -> frozenset[str]:
    """Return the addresses at which other hosts can reach this one; none where the system does not list them."""
    found: list[str] = []
    with suppress(OSError):
        found += re.findall(r"\|-- (\S+)(?:\n\s+/\d+ .*)*?\n\s+/32 host LOCAL", Path("/proc/net/fib_trie").read_text())
    with suppress(OSError):
        for line in Path("/proc/net/if_inet6").read_text().splitlines():
            address, *_, flags, _ = line.split()
            if not int(flags, 16) & _UNUSABLE:
                found.append(str(IPv6Address(int(address, 16))))
    return frozenset(filter(_reaches_others, found))


def at_addresses(listen: Collection[str], addresses: Collection[str]) -> tuple[str, ...]:
    """Return endpoints to listen on, with the addresses of this host in place of any address with any port.

    Zenoh then tells others these addresses. Without any address the endpoints stay.
    """
    found: list[str] = []
    for endpoint in listen:
        protocol, _, rest = endpoint.partition("/")
        here = sorted(text for text in addresses if (":" in text) == (rest == "[::]:0"))
        at = [f"{protocol}/[{text}]:0" if ":" in text else f"{protocol}/{text}:0" for text in here]
        found += at if at and rest in ("0.0.0.0:0", "[::]:0") else [endpoint]
    return tuple(found)


def address_in(locator: str) -> str:
    """Return the address in a locator of Zenoh; "" for a name, or an address that other hosts cannot reach.

    Examples
    --------
    >>> [*map(address_in, ("tcp/10.9.0.2:4711", "tls/[fd00::2]:1", "tcp/127.0.0.1:5", "tcp/[::ffff:10.9.0.2]:1"))]
    ['10.9.0.2', 'fd00::2', '', '10.9.0.2']
    """
    with suppress(ValueError):
        address = ip_address(locator.partition("/")[2].rpartition(":")[0].strip("[]"))
        text = str(getattr(address, "ipv4_mapped", None) or address)
        return text if _reaches_others(text) else ""
    return ""


def _reaches_others(text: str) -> bool:
    address = ip_address(text)
    return not (address.is_loopback or address.is_link_local or address.is_unspecified)


class LinkAddresses:
    """The addresses of this host that a session depends on."""

    def __init__(self, listen: Collection[str], here: Collection[str]) -> None:
        self._listen = listen
        self.endpoints = at_addresses(listen, here)
        """Endpoints to listen on, with the addresses of now."""
        self._used: set[str] = set()
        """Addresses that links came from while the host had them."""

    def moved(self, sources: Collection[str], here: Collection[str]) -> bool:
        """Return whether links use an address that the host has lost, or that this session does not tell others.

        `sources` are the addresses that links come from now. While the host has none a new session is of no use.
        """
        self._used.update(set(sources).intersection(here))
        told, anew = (set(map(address_in, listen)) for listen in (self.endpoints, at_addresses(self._listen, here)))
        return bool(here) and not self._used.isdisjoint((anew - told) | (self._used.difference(here)))


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


QUIET = 0.05
"""Time (s) without such a link after which none comes any more; on a busy machine the longest was 20 ms."""

LONGEST = 1.0
"""Longest search (s): somebody may connect again and again."""


def end_left_links() -> None:
    """End all links of Zenoh in this process, which has closed its one session, and those of the next `QUIET` seconds.

    Zenoh is left to close them: it reads their end, as if the other side had closed.
    """
    end = monotonic() + LONGEST
    quiet = monotonic() + QUIET
    while monotonic() < min(quiet, end):
        for same in tcp_sockets():
            with suppress(OSError):  # ended by the other side
                if linger(same)[1] == ZENOH_LINGERS:
                    same.shutdown(socket.SHUT_RDWR)
                    quiet = monotonic() + QUIET
        sleep(0.01)
