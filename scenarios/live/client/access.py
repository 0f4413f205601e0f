"""Options by which a command proves who it is, and the endpoints that go with them."""

from __future__ import annotations

from dataclasses import dataclass
from ipaddress import ip_address
from pathlib import Path

from gridpeers.scenarios.drivers.free_endpoint import parse_endpoint


@dataclass(frozen=True)
class Access:
    """The options `--keys`, `--as` and `--insecure` of a command."""

    keys: Path | None = None
    """Folder with the site's certificates."""
    name: str = ""
    """Name of the member; the first that fits if empty."""
    insecure: bool = False
    """Whether an endpoint that others reach may be open to everybody."""

    @property
    def words(self) -> list[str]:
        """The options as they are typed, for a command that this one starts or names, but for its own name."""
        keys = [] if self.keys is None else ["--keys", str(self.keys)]
        return [*keys, *(["--insecure"] if self.insecure else [])]


def objection(option: str, endpoint: str, *, keys: bool, insecure: bool) -> str:
    """Return why an endpoint cannot be used with or without certificates; empty if it can.

    Examples
    --------
    >>> objection("--connect", "tcp/127.0.0.1:7447", keys=False, insecure=False)
    ''
    >>> objection("--connect", "tls/10.0.0.1:7447", keys=False, insecure=True)
    '--connect: tls/10.0.0.1:7447 needs certificates: say --keys DIR, the folder that gridpeers keys init has made'
    """
    parsed = parse_endpoint(endpoint)
    assert parsed is not None
    if keys and parsed.protocol != "tls":
        return f"{option}: {endpoint} is open, and --keys asks for TLS: write {parsed._replace(protocol='tls')}"
    if not keys and parsed.protocol == "tls":
        return f"{option}: {endpoint} needs certificates: say --keys DIR, the folder that gridpeers keys init has made"
    if not (keys or insecure or is_loopback_host(parsed.host)):
        return (
            f"{option}: {endpoint} is not on this host's loopback, and without certificates whoever reaches it reads "
            f"and commands the run: say --keys DIR and {parsed._replace(protocol='tls')} (docs/security.md), or "
            "--insecure if you trust the network"
        )
    return ""


def is_loopback_host(host: str) -> bool:
    """Return whether an endpoint's host is this host's loopback.

    Examples
    --------
    >>> [is_loopback_host(host) for host in ("127.0.0.1", "[::1]", "localhost", "0.0.0.0", "127.lab.example")]
    [True, True, True, False, False]
    """
    try:
        return host == "localhost" or ip_address(host.strip("[]")).is_loopback
    except ValueError:  # a name that only begins like an address, as anybody may register it
        return False


def with_protocol(endpoint: str, *, keys: bool, default: str) -> str:
    """Return the default endpoint as it is with certificates; any other endpoint as it was typed.

    Examples
    --------
    >>> with_protocol("tcp/127.0.0.1:7447", keys=True, default="tcp/127.0.0.1:7447")
    'tls/127.0.0.1:7447'
    """
    return endpoint.replace("tcp/", "tls/", 1) if keys and endpoint == default else endpoint
