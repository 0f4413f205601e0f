"""What takes part in a run, on either side and in either kind of time: its routes, the checks of every message. Pure.

A message is decoded, which bounds all that is in it; then its sender and epoch are checked (`wire.admission`) and its
type; only then it reaches who handles it. Whatever is wrong with it, or goes wrong with it there, costs that message
alone.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Any, NamedTuple

from wire.actions import Action, Publish, Say
from wire.admission import Admission
from wire.codec import RejectedError, Rejects, decode
from wire.keys import Keys
from wire.messages import AnyMessage, Message

Handler = Callable[[Any, bytes, float], None]
"""Takes a message of one of its route's types, its bytes, and the time; RejectedError if it is not for here and now."""

ANYBODY = ""
"""Sender of a route on which whoever is there may speak."""


class Route(NamedTuple):
    """What may come on a key."""

    sender: str
    """Who speaks there."""
    types: tuple[type[Message], ...]
    """Types of its messages."""
    handle: Handler
    early: bool = False
    """Whether it may come before its sender is known, as a nameplate does: its handler looks to it."""


class Endpoint:
    """A core on a wire.

    Parameters
    ----------
    name : str
        Who it is.
    run : str
        Name of the run.
    rate : float, optional
        Most messages of one sender per s of run time; see `Admission`.
    """

    def __init__(self, name: str, run: str, rate: float = inf) -> None:
        self.keys = Keys(run)
        self.rejects = Rejects(name)
        self.admission = Admission(rate)
        self._routes: dict[str, Route] = {}
        self._actions: list[Action | Say] = []

    @property
    def over(self) -> bool:
        """Whether the driver should close."""
        raise NotImplementedError

    def take_actions(self) -> list[Action | Say]:
        """What is to be done now, in this order."""
        actions, self._actions = self._actions, []
        return actions

    def received(self, key: str, payload: bytes, now: float) -> None:
        """Take a message; what cannot be used is counted and dropped. What comes after the end is for nobody."""
        if self.over:
            return
        try:
            route = self._routes.get(key)
            if route is None:
                raise RejectedError("foreign", "nothing was asked for on this key")
            message = decode(payload)
            self._admit(route, message, now)
            if not isinstance(message, route.types):
                types = " or ".join(expected.__name__ for expected in route.types)
                raise RejectedError("unexpected", f"a {type(message).__name__} instead of a {types}")
            route.handle(message, payload, now)
            self._used(message, now)
        except RejectedError as rejected:
            self.rejects.add(rejected.kind, key, rejected.text)
        except Exception as error:
            # The last line of defence: an error of ours, which some message has found, is that message's end alone.
            self.rejects.failed(key, error)

    def _admit(self, route: Route, message: AnyMessage, now: float) -> None:
        """Make sure that a message is of whom its key says, and of the one that lives."""
        if route.sender == ANYBODY:
            return
        if message.sender != route.sender:
            self._misled(route.sender, message, now)
            raise RejectedError("foreign", f"sender {message.sender}, {route.sender} was expected")
        if not route.early:
            self.admission.check(message)

    def _misled(self, expected: str, message: AnyMessage, now: float) -> None:
        """Note a message that came under another's key."""

    def _used(self, message: AnyMessage, now: float) -> None:
        """Note a message that was of use."""

    def _publish(self, key: str, payload: bytes) -> None:
        self._actions.append(Publish(key, payload))
