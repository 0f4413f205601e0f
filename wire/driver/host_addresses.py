"""The addresses of this host now.

Zenoh lists them once in a process. After a change it would give others the old ones, in a new session too.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from contextlib import suppress
from ipaddress import IPv6Address, ip_address
from pathlib import Path

_OF_IPV4 = Path("/proc/net/fib_trie")
_OF_IPV6 = Path("/proc/net/if_inet6")

_UNUSABLE = 0x48
"""Flags of an IPv6 address that is not used yet, or is another host's: tentative, and dadfailed."""


def host_addresses() -> frozenset[str]:
    """Return the addresses at which other hosts can reach this one; none where the system does not list them."""
    ipv4 = ipv6 = ""
    with suppress(OSError):
        ipv4 = _OF_IPV4.read_text()
    with suppress(OSError):
        ipv6 = _OF_IPV6.read_text()
    return listed_addresses(ipv4, ipv6)


def listed_addresses(ipv4: str, ipv6: str) -> frozenset[str]:
    r"""Return the addresses in Linux's two lists, without loopback and link-local ones.

    Examples
    --------
    >>> ipv4 = "|-- 10.9.0.2\n /32 host LOCAL\n|-- 10.9.0.255\n /32 link BROADCAST\n|-- 127.0.0.1\n /32 host LOCAL\n"
    >>> ipv6 = "fd000000000000000000000000000002 04 40 00 80 eth0\nfe800000000000000000000000000002 04 40 20 80 eth0\n"
    >>> sorted(listed_addresses(ipv4, ipv6))
    ['10.9.0.2', 'fd00::2']
    """
    found = {match[1] for match in re.finditer(r"\|-- (\S+)(?:\n\s+/\d+ .*)*?\n\s+/32 host LOCAL", ipv4)}
    for line in ipv6.splitlines():
        address, *_, flags, _ = line.split()
        if not int(flags, 16) & _UNUSABLE:
            found.add(str(IPv6Address(int(address, 16))))
    return frozenset(text for text in found if _reaches_others(text))


def at_addresses(listen: Collection[str], addresses: Collection[str]) -> tuple[str, ...]:
    """Return endpoints to listen on, with the addresses of this host in place of any address with any port.

    Zenoh then tells others these addresses. Without any address the endpoints stay.

    Examples
    --------
    >>> at_addresses(("tcp/0.0.0.0:0", "tcp/[::]:0", "tcp/0.0.0.0:7447"), ("10.9.0.2", "fd00::2"))
    ('tcp/10.9.0.2:0', 'tcp/[fd00::2]:0', 'tcp/0.0.0.0:7447')
    >>> at_addresses(("tcp/0.0.0.0:0", "tcp/127.0.0.1:0"), ())
    ('tcp/0.0.0.0:0', 'tcp/127.0.0.1:0')
    """
    found: list[str] = []
    for endpoint in listen:
        protocol, _, rest = endpoint.partition("/")
        if rest == "0.0.0.0:0":
            at = [f"{protocol}/{text}:0" for text in sorted(addresses) if ":" not in text]
        elif rest == "[::]:0":
            at = [f"{protocol}/[{text}]:0" for text in sorted(addresses) if ":" in text]
        else:
            at = []
        found += at or [endpoint]
    return tuple(found)


def address_in(locator: str) -> str:
    """Return the address in a locator of Zenoh; "" for a name, or an address that other hosts cannot reach.

    Examples
    --------
    >>> [*map(address_in, ("tcp/10.9.0.2:4711", "tls/[fd00::2]:1", "tcp/127.0.0.1:5", "tcp/[::ffff:10.9.0.2]:1"))]
    ['10.9.0.2', 'fd00::2', '', '10.9.0.2']
    """
    host = locator.partition("/")[2].rpartition(":")[0].strip("[]")
    with suppress(ValueError):
        address = ip_address(host)
        text = str(getattr(address, "ipv4_mapped", None) or address)
        return text if _reaches_others(text) else ""
    return ""


def _reaches_others(text: str) -> bool:
    address = ip_address(text)
    return not (address.is_loopback or address.is_link_local or address.is_unspecified)


class LinkAddresses:
    """The addresses of this host that a session depends on.

    Parameters
    ----------
    listen : Collection[str]
        Endpoints to listen on, as they were asked for.
    here : Collection[str]
        The addresses of this host as the session opens.
    """

    def __init__(self, listen: Collection[str], here: Collection[str]) -> None:
        self._listen = listen
        self.endpoints = at_addresses(listen, here)
        """Endpoints to listen on, with the addresses of now."""
        self._used: set[str] = set()
        """Addresses that links came from while the host had them."""

    def moved(self, sources: Collection[str], here: Collection[str]) -> bool:
        """Return whether links use an address that the host has lost, or that this session does not tell others.

        Parameters
        ----------
        sources : Collection[str]
            Addresses that links come from now.
        here : Collection[str]
            The addresses of this host now; while it has none a new session is of no use.
        """
        self._used.update(set(sources).intersection(here))
        told, anew = (set(map(address_in, listen)) for listen in (self.endpoints, at_addresses(self._listen, here)))
        return bool(here) and not self._used.isdisjoint((anew - told) | (self._used.difference(here)))
