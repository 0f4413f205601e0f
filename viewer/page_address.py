"""Where the page listens: this host alone, unless another address is asked for."""

from __future__ import annotations

import errno
import ipaddress
import secrets
import socket

from gridpeers.scenarios.live.run_address import UsageError

LOOPBACK = ("127.0.0.1", "localhost", "[::1]")
"""Names of this host's loopback in the address of a page."""


def is_this_host(address: str) -> bool:
    """Return whether an address is this host's loopback.

    Examples
    --------
    >>> is_this_host("127.0.0.1"), is_this_host("localhost"), is_this_host("0.0.0.0")
    (True, True, False)
    """
    if address == "localhost":
        return True
    try:
        return ipaddress.ip_address(address).is_loopback
    except ValueError:
        return False


def listen(address: str, port: int) -> socket.socket:
    """Return a socket that listens; port 0 takes any free one.

    Raises
    ------
    UsageError
        If the address is none of this host, or the port is in use.
    """
    if not 0 <= port <= 65535:
        raise UsageError(f"--port: a port is a number from 0 to 65535, got {port}")
    try:
        family, kind, protocol, _, where = socket.getaddrinfo(address, port, type=socket.SOCK_STREAM)[0]
    except OSError:
        raise UsageError(f'--address: "{address}" is no address; 127.0.0.1 is this host alone, 0.0.0.0 all') from None
    listening = socket.socket(family, kind, protocol)
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(where)
        listening.listen(64)
    except OSError as error:
        listening.close()
        if error.errno == errno.EADDRINUSE:
            raise UsageError(
                f"--port: {port} of {address} is in use; give another one, or 0 for any free one"
            ) from None
        raise UsageError(f"--address: {address} cannot be listened on: {error.strerror}") from None
    return listening


def access(address: str, token: str) -> tuple[str, tuple[str, ...]]:
    """Return the token that a page must know, and the names under which the page answers; () takes any name.

    On this host's loopback no token is needed, and only names of this host are taken. Beyond it a token is: without a
    given one it is made up.

    Raises
    ------
    UsageError
        If the token is no text.

    Examples
    --------
    >>> access("127.0.0.1", "")
    ('', ('127.0.0.1', 'localhost', '[::1]'))
    """
    if token != token.encode(errors="replace").decode():
        raise UsageError("--token: has bytes that are no text; give letters and digits")
    if is_this_host(address):
        return token, tuple(dict.fromkeys((*LOOPBACK, address)))
    return token or secrets.token_urlsafe(16), ()


def url_of(listening: socket.socket, address: str) -> str:
    """Return the page's address for a browser of this host."""
    host = f"[{address}]" if ":" in address else address
    return f"http://{host}:{listening.getsockname()[1]}/"
