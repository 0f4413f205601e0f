"""The rendezvous of a run: a TCP port on the loopback, and whether a port can be listened on."""

from __future__ import annotations

import socket

HOST = "127.0.0.1"


class PortError(ValueError):
    """The port that the scenario names cannot be used."""


def endpoint(port: int) -> str:
    """Return the Zenoh endpoint at a port of this machine; for port 0 the driver takes a free one.

    Examples
    --------
    >>> endpoint(7447)
    'tcp/127.0.0.1:7447'
    """
    return f"tcp/{HOST}:{port}"


def probe(host: str, port: int) -> int:
    """Listen for a moment at a port of this machine, as the plant will, and return the port; a free one for 0.

    Parameters
    ----------
    host : str
        Name or address; an IPv6 address in brackets.
    port : int
        The port.

    Raises
    ------
    OSError
        If nobody can listen there now.
    """
    family = socket.AF_INET6 if host.startswith("[") else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as trial:
        # As the plant will listen: a port that only waits for the last packets of an earlier run is free.
        trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        trial.bind((host.strip("[]"), port))
        trial.listen()
        return int(trial.getsockname()[1])


def check_port(port: int) -> None:
    """Find out whether the plant will be able to listen on a port, before anything is started or written.

    Parameters
    ----------
    port : int
        The port; 0, which stands for any free one, can always be used.

    Raises
    ------
    PortError
        If the port is in use, or not ours to use.
    """
    try:
        probe(HOST, port)
    except OSError as error:
        raise PortError(
            f"processes.port: port {port} of {HOST} cannot be used: {(error.strerror or str(error)).lower()}; "
            "end what uses it, choose another, or write 0 to take a free one"
        ) from None
