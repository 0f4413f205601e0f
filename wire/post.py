"""The post of a node: keys and routes, the checks of every message that comes, requests to the driver. Pure.

Every message takes one way. `Post.received` decodes it, which checks its bounds; it checks sender and epoch
(`gridpeers.wire.membership`), and the type; then the handler of the message's route gets it. A wrong message, or an
error while it is handled, costs that message alone.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from gridpeers.wire.codec import RejectedError, RejectedMessages, decode, encode
from gridpeers.wire.journal import JournalBuffer, Traffic
from gridpeers.wire.keys import Keys, epoch_of
from gridpeers.wire.links import Links
from gridpeers.wire.membership import Admission, Membership
from gridpeers.wire.messages import PLANT, AnyMessage, Journal, LinkReport, Message, Nameplate
from gridpeers.wire.node import Action, Fetch, Listen, Log, Loss, Publish

Handler = Callable[[Any, bytes, float], None]
"""Takes a message of its route, its bytes, and the time; raises RejectedError if the message is unexpected."""

ANYBODY = ""  # Sender of a route that every participant may use


class Route(NamedTuple):
    """Sender, types and handler of the messages on a key."""

    sender: str
    """The only valid sender, or `ANYBODY`."""
    types: tuple[type[Message], ...]
    handle: Handler
    early: bool = False
    """Whether a message may arrive before its sender's epoch is known, as a nameplate does: its handler checks it."""
    relayed: tuple[type[Message], ...] = ()
    """Types that the plant passes on for others, whose messages it has checked."""


class Post:
    """What a node sends and receives under one name, in one epoch; it knows no phase and no kind of time."""

    def __init__(self, name: str, run: str, epoch: int, members: Membership | None = None) -> None:
        self.name, self.epoch = name, epoch
        self.keys = Keys(run)
        self.rejects = RejectedMessages(name)
        self.admission = Admission()
        self.members = Membership(self.admission) if members is None else members
        self.routes: dict[str, Route] = {}
        self.plant: FollowedPlant | None = None
        """The plant that the node follows; None for the plant's own node."""
        self.on_nameplate: Callable[[str, Nameplate, bool, float], None] = _ignore
        """Called with an instance, its answer, whether that is the first of a counting process, and the time."""
        self.vouches: Callable[[str], bool] | None = None
        """Says whether a link of this process has the certificate of a sender; None if links have no certificates."""
        self.journal: JournalBuffer | None = None
        self.traffic: Traffic | None = None
        """Notes messages and tokens in the journal; None if nobody records them here."""
        self.closed = False
        """Whether the node takes no more messages."""
        self.used = 0
        """Number of messages that were of use."""
        self.last_heard: dict[str, tuple[int, float]] = {}
        """Number and time (s) of the last message of each sender that was of use: its last sign of life."""
        self.actions: list[Action | Log] = []
        self._journal_parts = 0

    def take_actions(self) -> list[Action | Log]:
        if not self.actions:
            return []
        actions, self.actions = self.actions, []
        return actions

    def take_rejects(self) -> tuple[str, ...]:
        return self.rejects.take_lines()

    def received(self, key: str, payload: bytes, now: float) -> None:
        """Take a message; count and drop it if it cannot be used. After the end, ignore it."""
        if self.closed:
            return
        rejected_as = ""
        try:
            route = self.routes.get(key)
            if route is None:
                raise RejectedError("foreign", "this node has no subscription or query on this key")
            message = decode(payload)
            sender = message.sender
            if sender != route.sender or self.admission.epochs.get(sender) != message.epoch:
                self._admit(route, message)  # the rule, or the refusal, of all but the usual message
            if not isinstance(message, route.types):
                types = " or ".join(expected.__name__ for expected in route.types)
                raise RejectedError("unexpected", f"a {type(message).__name__} instead of a {types}")
            route.handle(message, payload, now)
            self.used += 1
            if route.sender:  # of anybody there is no end
                self.last_heard[sender] = message.seq, now
        except RejectedError as rejected:
            rejected_as = rejected.kind
            self.rejects.add(rejected.kind, key, rejected.text)
        except Exception as error:
            rejected_as = "failed"
            self.rejects.failed(key, error)
        if self.traffic is not None:
            self.traffic.received(key, payload, now, rejected_as)

    def lost(self, loss: Loss, now: float) -> None:
        """Count messages that the driver has dropped unread; the journal has their number."""
        self.rejects.add(loss.kind, loss.key, loss.text, count=loss.number)
        if self.traffic is not None:
            self.traffic.lost(loss.key, loss.kind, loss.number, now)

    def token(self, key: str, now: float, *, appeared: bool) -> tuple[str, ...]:
        """Note that a token appeared or vanished; return the parts of its key after the run, none if it is no token."""
        parts = self.keys.parts(key)
        if parts and self.traffic is not None:
            self.traffic.token(key, now, appeared=appeared)
        return parts

    def process_came(self, name: str, instance: str) -> bool:
        """Note the token of an agent's process and ask for its nameplate; return False if there is no room for it."""
        if self.members.has_room(name):
            self.members.appeared(name, instance)
            self.ask(name, instance)
            return True
        text = f"a token of {name}: too many processes hold tokens"
        self.rejects.add("excess", self.keys.alive_agent(name, instance), text)
        return False

    def process_gone(self, name: str, instance: str) -> bool:
        """Note that the token of an agent's process is gone; return whether the process counted."""
        self.routes.pop(self.keys.nameplate(name, instance), None)
        return self.members.vanished(name, instance)

    def ask(self, name: str, instance: str) -> None:
        """Ask a process for its nameplate."""
        key = self.keys.nameplate(name, instance)
        self.routes[key] = Route(name, (Nameplate,), partial(self._on_nameplate, instance), early=True)
        self.actions.append(Fetch(key))

    def ask_again(self) -> None:
        """Ask some of the processes that have not answered; all come in turn."""
        for name, instance in self.members.next_unmet():
            self.ask(name, instance)

    def listen(self, key: str, route: Route) -> None:
        """Subscribe to a key, unless that is done."""
        if key not in self.routes:
            self.routes[key] = route
            self.actions.append(Listen(key))

    def publish(self, key: str, payload: bytes) -> None:
        if self.traffic is not None:
            self.traffic.sent(key, payload)
        self.actions.append(Publish(key, payload))

    def send(self, key: str, *messages: AnyMessage) -> None:
        for message in messages:
            self.publish(key, encode(message))

    def say(self, text: str) -> None:
        """Log a line."""
        if self.traffic is not None:
            self.traffic.process("line", text)
        self.actions.append(Log(f"{self.name}: {text}"))

    def take_journal(self, t: float, *, empty: bool = False) -> list[Journal]:
        """Take out the journal since the last call; if it has no entries, there is a part only if `empty`."""
        if self.journal is None:
            return []
        parts = self.journal.take_parts() or ([b""] if empty else [])
        first, self._journal_parts = self._journal_parts, self._journal_parts + len(parts)
        name, epoch = self.name, self.epoch
        return [Journal(sender=name, epoch=epoch, seq=seq, t=t, data=data) for seq, data in enumerate(parts, first)]

    def take_link_reports(
        self, links: Links | None, *, t: float = 0.0, instance: str = "", last: bool = False
    ) -> list[LinkReport]:
        """Take out the account of the emulated links; its `last` part names the `instance`, if there is one."""
        parts = () if links is None else links.report(last=last)
        ends = [last and bool(instance) and data is parts[-1] for data in parts]
        name, epoch = self.name, self.epoch
        return [
            LinkReport(sender=name, epoch=epoch, seq=0, t=t, data=data, instance=instance, final=final)
            for data, final in zip(parts, ends, strict=True)
        ]

    def check_certificate(self, name: str) -> None:
        """Raise RejectedError if no link has the certificate of a name whose epoch is to be learnt.

        Access rules keep others off that name's keys; this check does not depend on them.
        """
        if self.vouches is not None and not self.vouches(name):
            raise RejectedError("impostor", f"{name} says who it is, but no link has the certificate of {name}")

    def _on_nameplate(self, instance: str, nameplate: Nameplate, payload: bytes, now: float) -> None:
        self.check_certificate(nameplate.sender)
        self.on_nameplate(instance, nameplate, self.members.meet(instance, nameplate), now)

    def _admit(self, route: Route, message: AnyMessage) -> None:
        """Raise RejectedError unless a message is from its key's sender, in that sender's epoch."""
        if route.sender == ANYBODY or isinstance(message, route.relayed):
            return
        if message.sender != route.sender:
            raise RejectedError("foreign", f"sender {message.sender}, {route.sender} was expected")
        if route.early:
            return
        if self.plant is not None and message.sender == PLANT:
            self.plant.heard(message.epoch)
        self.admission.check(message)


def _ignore(*arguments: object) -> None: ...


class FollowedPlant:
    """The plant that a node follows: the first present one that sends, until its token is gone."""

    def __init__(self, post: Post, on_follow: Callable[[int], None] = _ignore) -> None:
        self.present: set[int] = set()
        """Epochs of the plants that hold tokens."""
        self._post, self._on_follow = post, on_follow
        post.plant = self

    def appeared(self, part: str) -> bool:
        """Note a plant's token by its last part; return False if that is no epoch."""
        if (epoch := epoch_of(part)) is None:
            return False
        self.present.add(epoch)
        return True

    def vanished(self, part: str) -> bool:
        """Note that a plant's token is gone; return whether the node has no plant now."""
        if (epoch := epoch_of(part)) not in self.present:
            return False
        self.present.discard(epoch)
        followed = self._post.admission.epochs.get(PLANT)
        if followed == epoch:
            self._post.admission.release(PLANT)
        return followed == epoch or not self.present

    def heard(self, epoch: int) -> None:
        """Follow a present plant that sends, if the node follows none."""
        if epoch in self.present and PLANT not in self._post.admission.epochs:
            self._post.check_certificate(PLANT)
            self._post.admission.bind(PLANT, epoch)
            self._on_follow(epoch)
