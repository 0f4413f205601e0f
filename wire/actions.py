"""Requests of a sans-IO core to its driver. A driver performs them in the given order, and decides nothing."""

from __future__ import annotations

from typing import NamedTuple


class Publish(NamedTuple):
    """Publish bytes on a key."""

    key: str
    payload: bytes


class Fetch(NamedTuple):
    """Query a key; the answer arrives as a message on that key. A missing answer is no error."""

    key: str


class Listen(NamedTuple):
    """Subscribe to a key, before any later request."""

    key: str


class Log(NamedTuple):
    """Write a line to the log."""

    text: str


Action = Publish | Fetch | Listen
