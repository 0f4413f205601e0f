"""One direction of a relay: its faults, and the counts of its packets."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Annotated

import msgspec

from netem.models.delay import DELAY, LONGEST_DELAY
from wire.schema.plausible import Plausible, Probability, Unit
from wire.schema.table_schema import fields_of


class FaultsError(ValueError):
    """Values that cannot be meant; all of them in one message."""


class Faults(msgspec.Struct, frozen=True, kw_only=True):
    """Faults of one direction, in s, bytes/s and probabilities.

    Raises
    ------
    FaultsError
        If values cannot be meant: all of them at once.

    Examples
    --------
    >>> print(Faults(delay=0.1, jitter=0.02, loss=0.05))
    delay 0.1 s, jitter 0.02 s, loss 0.05
    >>> print(Faults())
    no fault
    >>> Faults(delay=200, loss=2)
    Traceback (most recent call last):
        ...
    netem.relay.direction.FaultsError: delay: 200 s is not plausible for a delay (0 to 10 s); did you mean 0.2 (200 ms)?
    loss: a loss is a probability from 0 to 1, got 2; did you mean 0.02 (2 %)?
    """

    delay: Annotated[float, Unit("s"), DELAY] = 0.0
    """Time on the way (s)."""
    jitter: Annotated[float, Unit("s"), Plausible("a jitter", 0.0, LONGEST_DELAY)] = 0.0
    """The delay is uniform within so much (s) of `delay`; datagrams then overtake each other, bytes of TCP never."""
    loss: Annotated[float, Probability("a loss")] = 0.0
    """Probability that a datagram is dropped; for TCP, that the transmission of a segment is, see
    `netem.relay.segments`."""
    rate: Annotated[float, Unit("bytes/s"), Plausible("a rate", 0.0, 1e11)] = 0.0
    """Bytes per second of each connection; 0 for no limit."""
    queue: Annotated[float, Unit("bytes"), Plausible("a queue", 1500.0, 1e9)] = 65536.0
    """Bytes that may wait for `rate`: datagrams beyond are dropped, a TCP sender is made to wait."""
    reorder: Annotated[float, Probability("reordering")] = 0.0
    """Probability that a datagram skips the delay and so overtakes those before it (udp only)."""

    def __post_init__(self) -> None:
        if problems := list(self._problems()):
            raise FaultsError("\n".join(problems))

    def _problems(self) -> Iterator[str]:
        for fault in fields_of(Faults):
            if text := fault.objection(getattr(self, fault.name)):
                yield f"{fault.name}: {text}"
        if 0.0 < self.rate < 1.0:
            yield f"rate: {self.rate:g} bytes/s; write at least 1, or 0 for no limit"
        if self.jitter > self.delay:
            yield f"jitter: {self.jitter:g} s is more than the delay of {self.delay:g} s; nothing arrives early"
        if self.reorder > 0.0 and self.delay == 0.0:
            yield f"reorder: {self.reorder:g} needs a delay: without one there is nothing to overtake"

    def delayed(self, u: float) -> float:
        """Return the delay (s) for a number drawn uniformly from 0 to 1."""
        return self.delay + self.jitter * (2.0 * u - 1.0)

    def __str__(self) -> str:
        given = [(fault, getattr(self, fault.name)) for fault in fields_of(Faults)]
        parts = [f"{fault.name} {value:g} {fault.unit}".rstrip() for fault, value in given if value != fault.default]
        return ", ".join(parts) or "no fault"


@dataclass
class PacketCounts:
    """Packets of one direction: datagrams, or segments of TCP.

    came = forwarded + lost + full + cut + waiting. For TCP `lost` stands outside of that sum: it counts transmissions,
    and each is repeated.
    """

    came: int = 0
    forwarded: int = 0
    lost: int = 0
    """By `loss`."""
    full: int = 0
    """Datagrams that found the queue of the rate full."""
    cut: int = 0
    """Lost by a cut or reset, or because nobody was there to take them."""

    def __str__(self) -> str:
        return f"{self.came} came, {self.forwarded} forwarded, {self.lost} lost, {self.full} full, {self.cut} cut"


@dataclass
class Direction:
    """One direction of a relay."""

    name: str
    """ "there", from whoever connects to the relay to its target, or "back"."""
    faults: Faults
    counts: PacketCounts = field(default_factory=PacketCounts)

    def __str__(self) -> str:
        return f"{self.name}: {self.faults}; {self.counts}"
