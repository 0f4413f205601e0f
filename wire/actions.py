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
    reply_key: str = ""
    """Key under which the answer arrives instead, to tell the answers of several queries apart."""


class Listen(NamedTuple):
    """Subscribe to a key, before any later request."""

    key: str


class WithdrawToken(NamedTuple):
    """Withdraw a liveliness token, whose node has finished."""

    key: str


class Log(NamedTuple):
    """Write a line to the log."""

    text: str


Action = Publish | Fetch | Listen | WithdrawToken
