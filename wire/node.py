"""A node: one participant of a run, on either side and under either kind of time. Messages in, actions out. Pure.

A node is sans-IO. A driver (`gridpeers.wire.driver.drive` over Zenoh, `gridpeers.scenarios.drivers.inprocess` on a bus)
owns it in one thread and does

    node.start(now)                                         before all else
    node.appeared(key, now) | node.vanished(key, now)       for a liveliness token that appears or vanishes
    node.received(key, payload, now)                        for a message, or the answer to a `Fetch`
    node.work(now)                                          for at most one piece of work, if it is ready
    for action in node.take_actions(): ...                  to perform the actions, in this order
    node.expire(now)                                        when `node.deadline` has passed
    node.lost(loss, now)                                    for messages that it has dropped unread
    for line in node.take_rejects(): ...                    for its log

until `node.finished`, the last actions included. `now` is the driver's clock (s).

Every message takes one way. `received` decodes it, which checks its bounds; it checks sender and epoch
(`gridpeers.wire.membership`), and the type; then the handler of the message's route gets it. A wrong message, or an
error while it is handled, costs that message alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple, Protocol

from gridpeers.wire.codec import RejectedError, RejectedMessages, decode, encode, is_marked
from gridpeers.wire.journal import JournalBuffer, Traffic
from gridpeers.wire.keys import Keys, epoch_of
from gridpeers.wire.links import Links
from gridpeers.wire.membership import Admission, Membership
from gridpeers.wire.messages import PLANT, AnyMessage, Journal, LinkReport, Message, Nameplate


class Publish(NamedTuple):
    key: str
    payload: bytes


class Fetch(NamedTuple):
    """Query a key; the answer arrives as a message on that key. A missing answer is no error."""

    key: str
    reply_key: str = ""
    """Key under which the answer arrives instead, to tell the answers of several queries apart."""


class Listen(NamedTuple):
    key: str


class WithdrawToken(NamedTuple):
    """Withdraw a liveliness token, whose node has finished."""

    key: str


class Log(NamedTuple):
    text: str


Action = Publish | Fetch | Listen | WithdrawToken


class Loss(NamedTuple):
    """Messages on one key that the driver has dropped unread."""

    key: str
    kind: str
    """One of `gridpeers.wire.codec.KINDS`."""
    text: str
    number: int


class Core(Protocol):
    """The part of a node that a driver uses; it asks `is_known` in any thread."""

    @property
    def tokens(self) -> tuple[str, ...]: ...

    @property
    def subscriptions(self) -> tuple[str, ...]:
        """Keys to subscribe to before the tokens are declared."""

    @property
    def watched(self) -> str: ...

    @property
    def finished(self) -> bool: ...

    @property
    def messages_needed(self) -> int:
        """Number of messages that it needs to continue before its deadline."""

    @property
    def deadline(self) -> float | None: ...

    def start(self, now: float) -> None: ...
    def take_actions(self) -> Sequence[Action | Log]: ...
    def take_rejects(self) -> tuple[str, ...]: ...
    def appeared(self, key: str, now: float) -> None: ...
    def vanished(self, key: str, now: float) -> None: ...
    def received(self, key: str, payload: bytes, now: float) -> None: ...
    def is_known(self, key: str, payload: bytes) -> bool: ...
    def lost(self, loss: Loss, now: float) -> None: ...
    def work(self, now: float) -> bool: ...
    def expire(self, now: float) -> None: ...


Handler = Callable[[Any, bytes, float], None]
"""Takes a message of its route, its bytes, and the time; raises RejectedError if the message is unexpected."""

CLOCK_ALONE = 1 << 30
"""`messages_needed` of a node that its clock wakes: messages wait for its next tick, only tokens and words wake it."""

ANYBODY = ""
"""Sender of a route that every participant may use."""


class Route(NamedTuple):
    """Sender, types and handler of the messages on a key."""

    sender: str
    """The only valid sender, or `ANYBODY`."""
    types: tuple[type[Message], ...]
    handle: Handler
    early: bool = False
    """Whether a message may arrive before its sender's epoch is known, as a nameplate does: its handler checks it."""


class Node:
    def __init__(self, name: str, run: str) -> None:
        self.keys = Keys(run)
        self.rejects = RejectedMessages(name)
        self.admission = Admission()
        self.members = Membership(self.admission)
        self._name = name
        self.routes: dict[str, Route] = {}
        self.vouches: Callable[[str], bool] | None = None
        """Says whether a link of this process has the certificate of a sender; None if links have no certificates."""
        self.journal: JournalBuffer | None = None
        self.traffic: Traffic | None = None
        """Notes messages and tokens in the journal; None if nobody records them here."""
        self._journal_parts = 0
        self._actions: list[Action | Log] = []

    @property
    def name(self) -> str:
        return self._name

    @property
    def token(self) -> str:
        raise NotImplementedError

    @property
    def tokens(self) -> tuple[str, ...]:
        return (self.token,)

    @property
    def watched(self) -> str:
        return self.keys.any_alive

    @property
    def finished(self) -> bool:
        raise NotImplementedError

    def take_actions(self) -> list[Action | Log]:
        if not self._actions:
            return []
        actions, self._actions = self._actions, []
        return actions

    def take_rejects(self) -> tuple[str, ...]:
        return self.rejects.take_lines()

    def received(self, key: str, payload: bytes, now: float) -> None:
        """Take a message; count and drop it if it cannot be used. After the end, ignore it."""
        if self.finished:
            return
        rejected_as = ""
        try:
            route = self.routes.get(key)
            if route is None:
                raise RejectedError("foreign", "this node has no subscription or query on this key")
            message = decode(payload)
            sender = message.sender
            if sender != route.sender or self.admission.epochs.get(sender) != message.epoch:
                self._admit(route, message, now)  # the rule, or the refusal, of all but the usual message
            if not isinstance(message, route.types):
                types = " or ".join(expected.__name__ for expected in route.types)
                raise RejectedError("unexpected", f"a {type(message).__name__} instead of a {types}")
            route.handle(message, payload, now)
            self._used(message, now)
        except RejectedError as rejected:
            rejected_as = rejected.kind
            self.rejects.add(rejected.kind, key, rejected.text)
        except Exception as error:
            rejected_as = "failed"
            self.rejects.failed(key, error)
        if self.traffic is not None:
            self.traffic.received(key, payload, now, rejected_as)

    def is_known(self, key: str, payload: bytes) -> bool:
        """Whether a message looks like one of the sender of its key, in its epoch; any thread may ask."""
        route = self.routes.get(key)
        epoch = None if route is None else self.admission.epochs.get(route.sender)
        return route is not None and epoch is not None and is_marked(payload, route.sender, epoch)

    def lost(self, loss: Loss, now: float) -> None:
        """Count messages that the driver has dropped unread; the journal has their number."""
        self.rejects.add(loss.kind, loss.key, loss.text, count=loss.number)
        if self.traffic is not None:
            self.traffic.lost(loss.key, loss.kind, loss.number, now)

    def _process_came(self, name: str, instance: str) -> bool:
        """Note the token of an agent's process and ask for its nameplate; return False if there is no room for it."""
        if self.members.has_room(name):
            self.members.appeared(name, instance)
            self._ask(name, instance)
            return True
        text = f"a token of {name}: too many processes hold tokens"
        self.rejects.add("excess", self.keys.alive_agent(name, instance), text)
        return False

    def _ask(self, name: str, instance: str) -> None:
        key = self.keys.nameplate(name, instance)
        self.routes[key] = Route(name, (Nameplate,), partial(self._on_nameplate, instance), early=True)
        self._actions.append(Fetch(key))

    def _on_nameplate(self, instance: str, nameplate: Nameplate, payload: bytes, now: float) -> None:
        self._check_certificate(nameplate.sender)
        if self.members.meet(instance, nameplate):
            self._met(nameplate, now)

    def _met(self, nameplate: Nameplate, now: float) -> None: ...

    def _forget_process(self, name: str, instance: str) -> bool:
        self.routes.pop(self.keys.nameplate(name, instance), None)
        return self.members.vanished(name, instance)

    def _admit(self, route: Route, message: AnyMessage, now: float) -> None:
        """Raise RejectedError unless a message is from its key's sender, in that sender's epoch."""
        if route.sender == ANYBODY:
            return
        if message.sender != route.sender:
            raise RejectedError("foreign", f"sender {message.sender}, {route.sender} was expected")
        if not route.early:
            self.admission.check(message)

    def _check_certificate(self, name: str) -> None:
        """Raise RejectedError if no link has the certificate of a name whose epoch is to be learnt.

        Access rules keep others off that name's keys; this check does not depend on them.
        """
        if self.vouches is not None and not self.vouches(name):
            raise RejectedError("impostor", f"{name} says who it is, but no link has the certificate of {name}")

    def _used(self, message: AnyMessage, now: float) -> None: ...

    def _publish(self, key: str, payload: bytes) -> None:
        if self.traffic is not None:
            self.traffic.sent(key, payload)
        self._actions.append(Publish(key, payload))

    def _note_token(self, key: str, now: float, *, appeared: bool) -> None:
        if self.traffic is not None and self.keys.parts(key):
            self.traffic.token(key, now, appeared=appeared)

    def _publish_journal(self, key: str, epoch: int, t: float, *, empty: bool = False) -> None:
        """Publish the journal since the last part; without entries only if asked for an `empty` one."""
        for journal in self._take_journal(epoch, t, empty=empty):
            self._publish(key, encode(journal))

    def _take_journal(self, epoch: int, t: float, *, empty: bool = False) -> Iterator[Journal]:
        if self.journal is None:
            return
        for data in self.journal.take_parts() or ([b""] if empty else []):
            yield Journal(sender=self._name, epoch=epoch, seq=self._journal_parts, t=t, data=data)
            self._journal_parts += 1

    def _publish_link_reports(
        self, key: str, links: Links | None, epoch: int, *, t: float = 0.0, instance: str = "", last: bool = False
    ) -> None:
        parts = () if links is None else links.report(last=last)
        for data in parts:
            final = last and bool(instance) and data is parts[-1]
            report = LinkReport(sender=self._name, epoch=epoch, seq=0, t=t, data=data, instance=instance, final=final)
            self._publish(key, encode(report))

    def _say(self, text: str) -> None:
        if self.traffic is not None:
            self.traffic.line(text)
        self._actions.append(Log(f"{self._name}: {text}"))


MOST_PLANTS = 64
"""Plants of one run that may hold tokens: two, while one replaces another; some that a recorder has outlived."""


class PlantFollower(Node):
    """A node that follows the present plant that sends first, until its token is gone; an agent, or a recorder."""

    def __init__(self, name: str, run: str) -> None:
        super().__init__(name, run)
        self._plants: set[int] = set()

    def _plant_appeared(self, part: str) -> bool:
        """Note a plant's token by its last part; return False if that is no epoch, or one of too many."""
        epoch = epoch_of(part)
        if epoch is None:
            return False
        if len(self._plants) >= MOST_PLANTS and epoch not in self._plants:
            text = f"the token of one more plant; {MOST_PLANTS} hold tokens"
            self.rejects.add("excess", self.keys.alive_plant(epoch), text)
            return False
        self._plants.add(epoch)
        return True

    def _plant_vanished(self, part: str) -> bool:
        """Note that a plant's token is gone; return whether this node has no plant now."""
        if (epoch := epoch_of(part)) not in self._plants:
            return False
        self._plants.discard(epoch)
        followed = self.admission.epochs.get(PLANT)
        if followed == epoch:
            self.admission.release(PLANT)
        return followed == epoch or not self._plants

    def is_known(self, key: str, payload: bytes) -> bool:
        route = self.routes.get(key)
        of_plant = route is not None and route.sender == PLANT
        return super().is_known(key, payload) or (
            of_plant and any(is_marked(payload, PLANT, epoch) for epoch in tuple(self._plants))
        )

    def _admit(self, route: Route, message: AnyMessage, now: float) -> None:
        """Check a message; first follow its plant if this node follows none."""
        epoch = message.epoch
        if route.sender == PLANT == message.sender and epoch in self._plants and PLANT not in self.admission.epochs:
            self._check_certificate(PLANT)
            self.admission.bind(PLANT, epoch)
            self._follow(epoch)
        super()._admit(route, message, now)

    def _follow(self, epoch: int) -> None: ...
