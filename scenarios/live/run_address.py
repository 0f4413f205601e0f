"""Address of a live run: its name, and the Zenoh endpoints where its processes meet."""

from __future__ import annotations

import errno
import re
import socket
from dataclasses import dataclass

from scenarios.drivers.ports import probe
from wire.keys import check_name

RUN = "gridpeers"
"""Name of a run that nobody has named."""

ENDPOINT = "tcp/127.0.0.1:7447"
"""Where the plant listens and the others connect, unless told otherwise; 7447 is Zenoh's own port."""

LONGEST = 1e9
"""Longest time (s) that anything is told to take, some 30 years: clocks cannot tell much more."""

PROBE = 1.0
"""Longest wait (s) for a TCP connection, to see whether anybody listens."""

_FORM = re.compile(
    r"(?P<protocol>[a-z]+)/(?P<host>\[[0-9A-Fa-f:.%a-z]+\]|[^\s:/\[\]]+):(?P<port>[0-9]{1,5})(?P<rest>[?#]\S*)?"
)
_PROTOCOLS = ("tcp", "tls", "quic", "udp")
_LOOPBACKS = ("127.", "localhost", "[::1]")


class UsageError(ValueError):
    """Something that was typed cannot be used; the message says what would be right."""


class InUseError(UsageError):
    """Something listens at an endpoint already."""


@dataclass(frozen=True, kw_only=True)
class RunAddress:
    """A run and where to find it."""

    run: str
    """Name of the run, part of every key."""
    connect: tuple[str, ...]
    """Endpoints to connect to; one that answers is enough."""

    def __str__(self) -> str:
        """As it stands in messages.

        Examples
        --------
        >>> print(RunAddress(run="demo", connect=("tcp/127.0.0.1:7447",)))
        run demo at tcp/127.0.0.1:7447
        """
        return f"run {self.run} at {', '.join(self.connect)}"


def address_of(run: str, connect: list[str] | None) -> RunAddress:
    """Check what the options `--run` and `--connect` say.

    Parameters
    ----------
    run : str
        Name of the run.
    connect : list[str] or None
        Endpoints; none stands for `ENDPOINT`.

    Raises
    ------
    UsageError
        If a name or an endpoint cannot be used.
    """
    return RunAddress(
        run=check_run(run), connect=tuple(check_endpoint("--connect", text) for text in connect or [ENDPOINT])
    )


def check_run(run: str) -> str:
    """Return the name of a run, if it can be a part of a Zenoh key.

    Examples
    --------
    >>> check_run("lab-2")
    'lab-2'
    """
    try:
        check_name("--run", run)
    except ValueError as error:
        raise UsageError(str(error)) from None
    return run


def check_wait(wait: float) -> float:
    """Return a longest wait (s), if it is one; infinity waits for ever.

    Examples
    --------
    >>> check_wait(2.5)
    2.5
    """
    if not wait >= 0.0:
        raise UsageError(f"--wait: must be a time of at least 0 s, got {wait:g} s")
    return wait


def check_duration(seconds: float | None) -> None:
    """Raise UsageError if a duration (s) cannot be one; None has no end."""
    if seconds is not None and not 0.0 < seconds <= LONGEST:
        raise UsageError(f"--for: must be a time of more than 0 s and at most {LONGEST:g} s, got {seconds:g} s")


def check_inverter(name: str) -> None:
    """Raise UsageError if a name cannot be that of an inverter."""
    try:
        check_name("INVERTER", name)
    except ValueError as error:
        raise UsageError(str(error)) from None


def check_endpoint(option: str, text: str) -> str:
    """Return an endpoint if it has the form of one.

    Parameters
    ----------
    option : str
        Where it was typed. For "--listen" port 0 stands for any free one.
    text : str
        E.g. "tcp/192.168.1.10:7447".

    Raises
    ------
    UsageError
        If Zenoh could make nothing of it.

    Examples
    --------
    >>> check_endpoint("--connect", "tcp/lab.example:7447")
    'tcp/lab.example:7447'
    """
    match = _FORM.fullmatch(text)
    if match is None:
        host = re.fullmatch(r"(?:\w+/)?([\w.-]+)(?::(\d+))?", text)
        example = f"tcp/{host[1]}:{host[2] or 7447}" if host else ENDPOINT
        raise UsageError(f'{option}: "{text}" is no endpoint; write PROTOCOL/HOST:PORT, e.g. {example}')
    if match["protocol"] not in _PROTOCOLS:
        raise UsageError(f'{option}: {text}: no protocol "{match["protocol"]}"; protocols are {", ".join(_PROTOCOLS)}')
    port, lowest = int(match["port"]), 0 if option == "--listen" else 1
    if not lowest <= port <= 65535:
        raise UsageError(f"{option}: {text}: a port is a number from {lowest} to 65535, got {port}")
    return text


def listenable(option: str, text: str) -> str:
    """Return an endpoint that this process will be able to listen on; a free port is chosen for port 0.

    Raises
    ------
    UsageError
        If the port is in use, or the address is not one of this machine.
    """
    match = _FORM.fullmatch(check_endpoint(option, text))
    assert match is not None
    if match["protocol"] not in ("tcp", "tls"):
        return text
    host, port = match["host"], int(match["port"])
    try:
        port = probe(host, port)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        kind = InUseError if error.errno == errno.EADDRINUSE else UsageError
        raise kind(f"{option}: {text} cannot be listened on: {reason}; {_way_out(host, error)}") from None
    return f"{match['protocol']}/{host}:{port}{match['rest'] or ''}"


def _way_out(host: str, error: OSError) -> str:
    """Return what to do when an address cannot be listened on."""
    if isinstance(error, socket.gaierror):
        return f"no address is known of {host}; give one of this host's own, or 0.0.0.0 for all of them"
    if error.errno == errno.EADDRINUSE:
        return (
            "end what uses it (gridpeers down ends a run there; a frozen plant goes on with kill -CONT, or ends by its "
            "process id), or choose another port, here by --listen and for the others by --connect"
        )
    if error.errno == errno.EADDRNOTAVAIL:
        return f"{host} is no address of this host; give one that it has, or 0.0.0.0 (IPv6: [::]) for all of them"
    return "choose another address or port, here by --listen and for the others by --connect"


def accepting(connect: tuple[str, ...]) -> tuple[str, ...]:
    """Those of some endpoints that accept a TCP connection, whether or not anything is said on it.

    Of a stopped process the system accepts connections in its stead.
    """
    return tuple(text for text in connect if _accepts(text))


def _accepts(text: str) -> bool:
    match = _FORM.fullmatch(text)
    assert match is not None
    if match["protocol"] not in ("tcp", "tls"):
        return False
    try:
        with socket.create_connection((match["host"].strip("[]"), int(match["port"])), PROBE):
            return True
    except OSError:
        return False


def return_path(connect: tuple[str, ...]) -> tuple[str, ...]:
    """Where a process must listen so that those it will be told of can connect to it.

    Examples
    --------
    >>> return_path(("tcp/127.0.0.1:7447",)), return_path(("tcp/192.168.1.10:7447",))
    (('tcp/127.0.0.1:0',), ('tcp/0.0.0.0:0',))
    """
    far = [host for host in _hosts(connect) if not host.startswith(_LOOPBACKS)]
    if not far:
        return ("tcp/127.0.0.1:0",)
    return ("tcp/[::]:0",) if far[0].startswith("[") else ("tcp/0.0.0.0:0",)


def is_loopback(connect: tuple[str, ...]) -> bool:
    """Whether all endpoints are on this machine's loopback.

    Examples
    --------
    >>> is_loopback(("tcp/127.0.0.1:7447",)), is_loopback(("tcp/127.0.0.1:7447", "tcp/192.168.1.10:7447"))
    (True, False)
    """
    return all(host.startswith(_LOOPBACKS) for host in _hosts(connect))


def _hosts(connect: tuple[str, ...]) -> list[str]:
    matches = [_FORM.fullmatch(text) for text in connect]
    return [match["host"] for match in matches if match is not None]


def loopback_of(listen: str) -> str:
    """Where a process of the same machine connects to who listens there.

    Examples
    --------
    >>> loopback_of("tcp/0.0.0.0:7447"), loopback_of("tcp/[::]:7447"), loopback_of("tcp/10.0.0.1:7447")
    ('tcp/127.0.0.1:7447', 'tcp/[::1]:7447', 'tcp/10.0.0.1:7447')
    """
    return listen.replace("/0.0.0.0:", "/127.0.0.1:").replace("/[::]:", "/[::1]:")


def next_port(listen: str) -> str:
    """Return the same endpoint at the port beside.

    Examples
    --------
    >>> next_port("tcp/127.0.0.1:7447"), next_port("tcp/[::1]:65535")
    ('tcp/127.0.0.1:7448', 'tcp/[::1]:65534')
    """
    match = _FORM.fullmatch(listen)
    assert match is not None
    port = int(match["port"])
    return f"{match['protocol']}/{match['host']}:{port + 1 if port < 65535 else port - 1}"
