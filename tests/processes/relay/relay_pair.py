"""Pairs of Zenoh sessions, and the time that each of many messages takes from the one to the other."""

from __future__ import annotations

import random
import socket
from collections.abc import Callable
from contextlib import suppress
from struct import pack, unpack_from
from time import monotonic
from types import TracebackType

from wire.driver.inbox import Event, Inbox
from wire.driver.session import Session

KEY = "gridpeers/pair/probe"
HELLO = -1
"""Number of a greeting."""

PATIENCE = 60.0
"""Longest wait (s) for two to find each other."""

SIZE = 100
"""Bytes of a message: about a State."""

LOST = float("inf")
"""Time that a message takes that never comes."""

NEVER = 1 << 30
"""More messages than ever come: who waits for so many waits for the time."""


def free_endpoint(transport: str) -> str:
    """Endpoint at a port of the loopback that nobody uses, nor gets by asking for any: relays do that meanwhile."""
    kind = socket.SOCK_STREAM if transport == "tcp" else socket.SOCK_DGRAM
    for port in random.SystemRandom().sample(range(20_000, 32_000), 100):
        with socket.socket(socket.AF_INET, kind) as probe, suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return f"{transport}/127.0.0.1:{port}"
    raise AssertionError("a hundred ports are in use")


class Times(Inbox):
    """When each numbered message came, taken in Zenoh's thread (s); greetings wake the owner."""

    def __init__(self) -> None:
        super().__init__()
        self.came: dict[int, float] = {}

    def put(self, event: Event) -> None:
        """Note a message, from any thread."""
        (number,) = unpack_from("<q", event[2])
        if number == HELLO:
            super().put(event)
        else:
            self.came[number] = monotonic()


class Pair:
    """A session that listens and one that connects, perhaps through a relay. Use it as a context.

    Parameters
    ----------
    listen : str
        Endpoint of the receiver.
    connect : str, optional
        What the sender connects to, unless to the receiver.
    """

    def __init__(self, listen: str, connect: str = "") -> None:
        self.receiver = Session("receiver", listen=(listen,), gossip=False, clock="wall")
        self.receiver.inbox = self._times = Times()
        self.receiver.subscribe(KEY)
        self.sender = Session("sender", connect=(connect or listen,), gossip=False, clock="wall")
        self._sent: list[float] = []

    def __enter__(self) -> Pair:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.sender.close()
        self.receiver.close()

    def greet(self) -> None:
        """Return when a greeting has come: they are linked, and what was sent before it has come or never will."""

        def heard() -> bool:
            self._publish(HELLO)
            return bool(self.receiver.inbox.take(1, 0.02))

        self.until(heard)

    def until(self, happens: Callable[[], object]) -> None:
        """Return once something has happened; look every few milliseconds."""
        end = monotonic() + PATIENCE
        while not happens():
            if monotonic() > end:
                raise TimeoutError(f"it did not happen within {PATIENCE:g} s")
            self.sender.inbox.take(NEVER, 0.005)

    def send(self) -> None:
        """Send the next message."""
        number = len(self._sent)
        self._sent.append(monotonic())
        self._publish(number)

    def times(self) -> list[float]:
        """How long each took (s) so far; then start anew."""
        took = [self._times.came.get(number, LOST) - at for number, at in enumerate(self._sent)]
        self._sent.clear()
        self._times.came.clear()
        return took

    def _publish(self, number: int) -> None:
        self.sender.publish(KEY, pack("<q", number) + bytes(SIZE - 8))


def measure(pairs: list[Pair], count: int, gap: float, over: Callable[[], object]) -> list[list[float]]:
    """How long messages take, sent by all pairs at the same times.

    Parameters
    ----------
    pairs : list[Pair]
        Who talks; each has been greeted.
    count, gap : int, float
        Messages of each pair; time between two (s).
    over : Callable[[], object]
        Called after the last: ends the loss, so that a greeting tells when all has come.
    """
    idle, due = Inbox(), monotonic()
    for _ in range(count):
        for pair in pairs:
            pair.send()
        due += gap
        while (left := due - monotonic()) > 0:
            idle.take(NEVER, left)
    over()
    for pair in pairs:
        pair.greet()
    return [pair.times() for pair in pairs]
