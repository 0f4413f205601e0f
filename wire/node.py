"""A node: one participant of a run, on either side and under either kind of time. Messages in, actions out. Pure.

A node is sans-IO. A driver (`gridpeers.wire.driver.drive` over Zenoh, `gridpeers.scenarios.drivers.inprocess` on a bus)
owns it in one thread, calls the methods of `Core` with its clock (s), and performs the actions in their order, until
the node has finished. Its post (`gridpeers.wire.post`) checks and routes its messages and collects its actions.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol


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
    """The part of a node that a driver uses."""

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
    def lost(self, loss: Loss, now: float) -> None: ...

    def work(self, now: float) -> bool:
        """Do at most one piece of work that is ready; return whether there was one."""

    def expire(self, now: float) -> None:
        """Act, as the deadline has passed."""


CLOCK_ALONE = 1 << 30
"""`messages_needed` of a node that its clock wakes: messages wait for its next tick, only tokens and words wake it."""
