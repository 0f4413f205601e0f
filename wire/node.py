"""A node: what takes part in a run, on either side and under either kind of time. Messages in, actions out. Pure.

A node is sans-IO. A driver (`wire.driver.drive` over Zenoh, `scenarios.drivers.inprocess` on a bus) owns it in one
thread and does

    node.appeared(key, now) | node.vanished(key, now)       a liveliness token came or went
    node.received(key, payload, now)                        a message, or the answer to a `Fetch`
    node.work(now)                                          at most one piece of work, if all is here for it
    for action in node.take_actions(): ...                  do it, in this order
    node.expire(now)                                        when `node.deadline` has passed

until `node.finished`, the last actions included. `now` is the driver's clock (s).

Every message takes one way: it is decoded, which bounds all that is in it; its sender and epoch are checked
(`wire.admission`), and its type; then the handler of its route gets it. Whatever is wrong with a message, or goes wrong
while it is handled, costs that message alone.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import inf
from typing import Any, NamedTuple

from wire.actions import Action, Fetch, Log, Publish
from wire.admission import Admission
from wire.codec import RejectedError, RejectedMessages, decode, encode
from wire.keys import Keys
from wire.links import Links
from wire.membership import Membership
from wire.messages import AnyMessage, LinkReport, Message, Nameplate

Handler = Callable[[Any, bytes, float], None]
"""Takes a message of one of its route's types, its bytes, and the time; RejectedError if it is not for here and now."""

CLOCK_ALONE = 1 << 30
"""Messages needed by a node that its clock wakes: they wait for its next tick; only tokens and words wake it before."""

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


class Node:
    """What an agent, the plant and a recorder have in common.

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
        self.rejects = RejectedMessages(name)
        self.admission = Admission(rate)
        self.members = Membership(self.admission)
        self._name = name
        self.routes: dict[str, Route] = {}
        self._actions: list[Action | Log] = []

    @property
    def finished(self) -> bool:
        """Whether the driver should close."""
        raise NotImplementedError

    def take_actions(self) -> list[Action | Log]:
        """What is to be done now, in this order."""
        actions, self._actions = self._actions, []
        return actions

    def received(self, key: str, payload: bytes, now: float) -> None:
        """Take a message; what cannot be used is counted and dropped. What comes after the end is for nobody."""
        if self.finished:
            return
        try:
            route = self.routes.get(key)
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

    @property
    def watched(self) -> str:
        """Key expression of the tokens to watch."""
        return self.keys.any_alive

    # ---------------------------------------------------------------- nameplates

    def _ask(self, name: str, instance: str) -> None:
        """Ask a process who it is."""
        key = self.keys.nameplate(name, instance)
        self.routes[key] = Route(name, (Nameplate,), partial(self._on_nameplate, instance), early=True)
        self._actions.append(Fetch(key))

    def _on_nameplate(self, instance: str, nameplate: Nameplate, payload: bytes, now: float) -> None:
        if self.members.meet(instance, nameplate):
            self._met(nameplate, now)

    def _met(self, nameplate: Nameplate, now: float) -> None:
        """Note who somebody is who counts from now on."""

    def _forget_process(self, name: str, instance: str) -> bool:
        """Note that the token of a process is gone; whether it counted."""
        self.routes.pop(self.keys.nameplate(name, instance), None)
        return self.members.vanished(name, instance)

    # ---------------------------------------------------------------- checks

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

    def _publish_link_reports(
        self, key: str, links: Links | None, epoch: int, *, t: float = 0.0, instance: str = "", last: bool = False
    ) -> None:
        """Publish what the emulated links into this node did since the last report."""
        parts = () if links is None else links.report(last=last)
        for data in parts:
            final = last and bool(instance) and data is parts[-1]
            report = LinkReport(sender=self._name, epoch=epoch, seq=0, t=t, data=data, instance=instance, final=final)
            self._publish(key, encode(report))

    def _say(self, text: str) -> None:
        """Have a line logged."""
        self._actions.append(Log(f"{self._name}: {text}"))
