"""How a command names a run and proves who it is: name, endpoints, certificates, and the checks of such options."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from ipaddress import ip_address
from pathlib import Path

from gridpeers.scenarios.drivers.free_endpoint import parse_endpoint
from gridpeers.wire.keys import check_name as check_key_part
from gridpeers.wire.trust.credentials import Credentials
from gridpeers.wire.wording import InputError

RUN = "gridpeers"

ENDPOINT = "tcp/127.0.0.1:7447"
"""Default endpoint where the plant listens and the others connect; 7447 is Zenoh's own port."""

LONGEST_TIME = 1e9  # Longest time (s) of any option, some 30 years

_PROTOCOLS = ("tcp", "tls", "quic", "udp")


class UsageError(InputError):
    """An option or argument cannot be used; the message says what would be right."""


@dataclass(frozen=True)
class Access:
    keys: Path | None = None
    name: str = ""
    """Name of the member; the first that fits if empty."""
    insecure: bool = False
    """True if an endpoint that others reach may be open to everybody."""

    @property
    def words(self) -> list[str]:
        """The options as typed, without the name of the command."""
        keys = [] if self.keys is None else ["--keys", str(self.keys)]
        return [*keys, *(["--insecure"] if self.insecure else [])]


@dataclass(frozen=True, kw_only=True)
class RunAddress:
    run: str
    connect: tuple[str, ...]
    """Endpoints to connect to; one that answers is enough."""
    credentials: Credentials | None = None
    access: Access = field(default_factory=Access)
    """The options that gave them, for commands that start others."""

    @property
    def words(self) -> list[str]:
        """The options by which a command on the same host finds this run, without those that have their defaults."""
        near = tuple(map(loopback_of, self.connect))
        default = with_protocol(ENDPOINT, keys=self.access.keys is not None, default=ENDPOINT)
        run = [] if self.run == RUN else ["--run", self.run]
        connect = [] if near == (default,) else [word for each in near for word in ("--connect", each)]
        return [*run, *connect, *self.access.words]

    def __str__(self) -> str:
        return f"run {self.run} at {', '.join(self.connect)}"


def address_of(run: str, connect: list[str] | None) -> RunAddress:
    return RunAddress(
        run=check_name("--run", run), connect=tuple(check_endpoint("--connect", text) for text in connect or [ENDPOINT])
    )


def objection(option: str, endpoint: str, *, keys: bool, insecure: bool) -> str:
    """Return why an endpoint cannot be used with or without certificates; empty if it can."""
    parsed = parse_endpoint(endpoint)
    assert parsed is not None
    tls = parsed._replace(protocol="tls")
    if keys and parsed.protocol != "tls":
        return f"{option}: {endpoint} is open, and --keys needs TLS: write {tls}"
    if not keys and parsed.protocol == "tls":
        return f"{option}: {endpoint} needs certificates: use --keys DIR, a folder made by gridpeers keys init"
    if not (keys or insecure or is_loopback_host(parsed.host)):
        return (
            f"{option}: {endpoint} is not on this host's loopback, and without certificates whoever reaches it reads "
            f"and commands the run; use --keys DIR and {tls} (docs/how-to/several-hosts.md), or --insecure on a "
            "network that you trust"
        )
    return ""


def with_protocol(endpoint: str, *, keys: bool, default: str) -> str:
    """Return the default endpoint with the protocol for certificates; any other endpoint as typed."""
    return endpoint.replace("tcp/", "tls/", 1) if keys and endpoint == default else endpoint


def check_name(option: str, name: str) -> str:
    """Return the name of a run or an inverter, if it can be a part of a Zenoh key."""
    try:
        check_key_part(option, name)
    except ValueError as error:
        raise UsageError(str(error)) from None
    return name


def check_inverters(names: Sequence[str]) -> None:
    for name in names:
        check_name("INVERTER", name)
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise UsageError(f"INVERTER: {', '.join(twice)} is given twice; one agent controls an inverter")


def check_wait(wait: float) -> None:
    if not wait >= 0.0:
        raise UsageError(f"--wait: must be a time of at least 0 s, got {wait:g} s")


def check_duration(seconds: float | None) -> None:
    if seconds is not None and not 0.0 < seconds <= LONGEST_TIME:
        raise UsageError(f"--for: must be a time of more than 0 s and at most {LONGEST_TIME:g} s, got {seconds:g} s")


def check_endpoint(option: str, text: str) -> str:
    """Return an endpoint if Zenoh can use it, else raise UsageError; port 0 is any free one, for "--listen" alone."""
    endpoint = parse_endpoint(text)
    if endpoint is None:
        host = re.fullmatch(r"(?:\w+/)?([\w.-]+)(?::(\d+))?", text)
        example = f"tcp/{host[1]}:{host[2] or 7447}" if host else ENDPOINT
        raise UsageError(f'{option}: "{text}" is no endpoint; write PROTOCOL/HOST:PORT, e.g. {example}')
    if endpoint.protocol not in _PROTOCOLS:
        raise UsageError(f'{option}: {text}: no protocol "{endpoint.protocol}"; protocols are {", ".join(_PROTOCOLS)}')
    lowest = 0 if option == "--listen" else 1
    if not lowest <= endpoint.port <= 65535:
        raise UsageError(f"{option}: {text}: a port is a number from {lowest} to 65535, got {endpoint.port}")
    return text


def is_loopback_host(host: str) -> bool:
    try:
        return host == "localhost" or ip_address(host.strip("[]")).is_loopback
    except ValueError:  # a name that only begins like an address, as anybody may register it
        return False


def far_hosts(connect: tuple[str, ...]) -> list[str]:
    hosts = [endpoint.host for text in connect if (endpoint := parse_endpoint(text))]
    return [host for host in hosts if not is_loopback_host(host)]


def return_path(connect: tuple[str, ...]) -> tuple[str, ...]:
    """Return the endpoint where a process must listen, so that others of the run can connect to it."""
    protocol = "tls" if all(text.startswith("tls/") for text in connect) else "tcp"
    far = far_hosts(connect)
    host = "127.0.0.1" if not far else "[::]" if far[0].startswith("[") else "0.0.0.0"
    return (f"{protocol}/{host}:0",)


def loopback_of(listen: str) -> str:
    return listen.replace("/0.0.0.0:", "/127.0.0.1:").replace("/[::]:", "/[::1]:")
