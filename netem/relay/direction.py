"""One direction of a relay: what is set, and what was counted. And whether anything passes at all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from netem.relay.bottleneck import NEVER
from netem.relay.faults import Faults


@dataclass
class Counts:
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
    """What a cut or reset took, or nobody was there to take."""

    def __str__(self) -> str:
        parts = (f"{self.lost} lost", f"{self.full} full", f"{self.cut} cut")
        return ", ".join((f"{self.came} came", f"{self.forwarded} forwarded", *parts))


@dataclass
class Direction:
    """One direction."""

    name: str
    faults: Faults
    counts: Counts = field(default_factory=Counts)

    def __str__(self) -> str:
        return f"{self.name}: {self.faults}; {self.counts}"


@dataclass
class Road:
    """Both directions, and the gate across them."""

    there: Direction
    back: Direction
    seed: int
    opens: float = -NEVER
    """When the stall is over (s on the loop's clock)."""
    is_cut: bool = False
    connections: int = 0
    """How many there have been; each has its number, from 1."""
    listeners: set[Callable[[], None]] = field(default_factory=set)
    """Called when something has changed."""

    def new_connection(self) -> int:
        """Number of a new connection."""
        self.connections += 1
        return self.connections

    def changed(self) -> None:
        """Have everybody look again."""
        for listener in list(self.listeners):
            listener()
