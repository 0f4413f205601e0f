"""What a sans-IO core asks its driver to do. Drivers do it in the order given, and decide nothing."""

from __future__ import annotations

from typing import NamedTuple


class Publish(NamedTuple):
    """Publish bytes on a key."""

    key: str
    payload: bytes


class Fetch(NamedTuple):
    """Ask the queryable of a key; what it answers comes in as a message on that key. No answer is no error."""

    key: str


class Listen(NamedTuple):
    """Subscribe to a key, from now on, before anything that is asked for later."""

    key: str


class Log(NamedTuple):
    """Write a line to the log, for whoever watches the process."""

    text: str


Action = Publish | Fetch | Listen
