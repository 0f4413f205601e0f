"""Choose the rendezvous of a run: an endpoint that is free, and stays so until the plant listens there."""

from __future__ import annotations

import random

from scenarios.drivers.ports import probe
from wire.driver.session import SessionError

_OWN = range(20_000, 32_000)
"""Ports that no system gives to whoever asks for any (Linux begins at 32768). One of those the agents, who start with
the plant, would now and then be given themselves: for listening, or as the near end of a call to the plant."""

_TRIES = 100


def rendezvous(listen: tuple[str, ...] = ()) -> str:
    """Return the endpoint of the rendezvous: the given one, if it is free, or a free one of this host.

    Raises
    ------
    SessionError
        If it cannot be used.
    """
    endpoint = listen[0] if listen else "tcp/127.0.0.1:0"
    protocol, _, address = endpoint.partition("/")
    host, _, port = address.rpartition(":")
    if protocol != "tcp" or not host or not port.isascii() or not port.isdigit():
        raise SessionError(
            f'listen: "{endpoint}" is no endpoint; use e.g. tcp/127.0.0.1:7447, or port 0 for a free one'
        )
    wanted = [int(port)] if int(port) else random.SystemRandom().sample(_OWN, _TRIES)
    why = ""
    for number in wanted:
        try:
            probe(host, number)
        except OSError as error:
            why = error.strerror or str(error)
        else:
            return f"{protocol}/{host}:{number}"
    raise SessionError(f"listen: cannot use {endpoint}: {why}; choose another port, or 0 for a free one")
