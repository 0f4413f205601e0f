"""A Zenoh endpoint of a relay: transport, host and port."""

from __future__ import annotations

from typing import Literal, NamedTuple

Transport = Literal["tcp", "udp"]


class EndpointError(ValueError):
    """A text is no endpoint that can be relayed."""


class Endpoint(NamedTuple):
    """Where to listen or to connect.

    Examples
    --------
    >>> Endpoint.parse("tcp/127.0.0.1:7447")
    Endpoint(transport='tcp', host='127.0.0.1', port=7447)
    >>> str(Endpoint.parse("udp/[::1]:0"))
    'udp/[::1]:0'
    >>> Endpoint.parse("127.0.0.1:7447")
    Traceback (most recent call last):
        ...
    netem.relay.endpoint.EndpointError: "127.0.0.1:7447" is no endpoint; write e.g. tcp/127.0.0.1:7447 or udp/[::1]:7447
    """

    transport: Transport
    host: str
    port: int
    """0 to listen on any free one."""

    @classmethod
    def parse(cls, text: str) -> Endpoint:
        """Read an endpoint as Zenoh writes it; raise EndpointError if it is none that a relay knows."""
        transport, _, place = text.partition("/")
        host, _, port = place.rpartition(":")
        host = host.removeprefix("[").removesuffix("]")
        if not host or not port.isascii() or not port.isdigit() or int(port) > 65535:
            raise EndpointError(f'"{text}" is no endpoint; write e.g. tcp/127.0.0.1:7447 or udp/[::1]:7447')
        match transport:
            case "tcp" | "udp":
                return cls(transport, host, int(port))
        raise EndpointError(f'"{text}": a relay knows tcp and udp, not "{transport}"')

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.transport}/{host}:{self.port}"
