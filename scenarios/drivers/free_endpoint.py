"""Endpoints where a process of this host can listen: their form, and a check before anything is started or written.

Zenoh itself listens, some time after this module has chosen a free port. Until then the choosing process claims the
port: it binds the UDP port of the same number, which no other process can bind. TCP, where Zenoh listens, stays free.
"""

from __future__ import annotations

import errno
import random
import re
import socket
from collections import deque
from typing import NamedTuple

from gridpeers.wire.driver.command_line import command_line
from gridpeers.wire.wording import InputError

_FORM = re.compile(
    r"(?P<protocol>[a-z]+)/(?P<host>\[[0-9A-Fa-f:.%a-z]+\]|[^\s:/\[\]]+):(?P<port>[0-9]{1,5})(?P<rest>[?#]\S*)?"
)

_PORTS = range(25_000, 32_768, 2)
"""Ports to choose from. The kernel gives higher ones to processes that ask for any (Linux from 32768). HELICS numbers
its federates from 23404, and its broker uses the next port too."""

_CLAIMS: deque[int] = deque()
"""File descriptors of the latest `_MOST_CLAIMS` claims: Zenoh listens on the ports of older ones, or has ended."""

_MOST_CLAIMS = 32


class ListenError(InputError):
    """Nobody can listen at an endpoint; the message gives the reason and the ways out."""


class ZenohEndpoint(NamedTuple):
    protocol: str
    host: str
    """Name or address; an IPv6 address in brackets."""
    port: int
    rest: str
    """Zenoh's own suffix, e.g. "#iface=eth0"."""

    def __str__(self) -> str:
        return f"{self.protocol}/{self.host}:{self.port}{self.rest}"

    @property
    def connects(self) -> bool:
        return self.protocol in ("tcp", "tls")


def parse_endpoint(text: str) -> ZenohEndpoint | None:
    match = _FORM.fullmatch(text)
    return match and ZenohEndpoint(match["protocol"], match["host"], int(match["port"]), match["rest"] or "")


def local_endpoint(port: int) -> str:
    return f"tcp/127.0.0.1:{port}"


def free_endpoint(text: str = "tcp/127.0.0.1:0", *, option: str = "listen") -> str:
    """Return an endpoint where a process of this host will be able to listen, else ListenError.

    Port 0 becomes a free one, which this process claims.
    """
    endpoint = parse_endpoint(text)
    if endpoint is None:
        raise ListenError(f'{option}: "{text}" is no endpoint; write e.g. tcp/127.0.0.1:7447, or port 0 for a free one')
    if not endpoint.connects:
        return text
    ports = [endpoint.port] if endpoint.port else random.SystemRandom().sample(_PORTS, min(100, len(_PORTS)))
    family = socket.AF_INET6 if endpoint.host.startswith("[") else socket.AF_INET
    for port in ports:
        try:
            with socket.socket(family, socket.SOCK_STREAM) as trial:
                # as the plant will listen: a port that only waits for the last packets of an earlier run is free
                trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                trial.bind((endpoint.host.strip("[]"), port))
                trial.listen()
                if not endpoint.port:
                    _claim(port)
        except OSError as error:
            reason = error
            continue
        return str(endpoint._replace(port=port))
    raise ListenError(
        f"{option}: {text} cannot be used: {(reason.strerror or str(reason)).lower()}; "
        f"{_way_out(endpoint.host, reason)}"
    )


def _claim(port: int) -> None:
    """Raise OSError if another choice has claimed the port."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as claim:
        claim.bind(("127.0.0.1", port))
        _CLAIMS.append(claim.detach())
    if len(_CLAIMS) > _MOST_CLAIMS:
        socket.close(_CLAIMS.popleft())


def _way_out(host: str, error: OSError) -> str:
    if isinstance(error, socket.gaierror) or error.errno == errno.EADDRNOTAVAIL:
        return f"{host} is not an address of this host; give one of its own, or 0.0.0.0 (IPv6: [::]) for all of them"
    other = "choose another port, or 0 for a free one, and connect the others to that port"
    if error.errno == errno.EADDRINUSE:
        ends = f"{command_line('down')} ends a live run; kill -CONT wakes a frozen plant"
        return f"end its user ({ends}), or {other}"
    return other
