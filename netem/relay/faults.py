"""What one direction of a relay does to the traffic."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields

from netem.models.delay.delay_model import LONGEST_DELAY
from wire.plausible import Plausible, Probability


class FaultsError(ValueError):
    """Values that cannot be meant; all of them in one message."""


@dataclass(frozen=True, kw_only=True)
class Faults:
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
    netem.relay.faults.FaultsError: delay: 200 s is not plausible for a delay (0 to 10 s); did you mean 0.2 (200 ms)?
    loss: a loss is a probability from 0 to 1, got 2; did you mean 0.02 (2 %)?
    """

    delay: float = 0.0
    """Time on the way (s)."""
    jitter: float = 0.0
    """The delay is uniform within so much (s) of `delay`; datagrams then overtake each other, bytes of TCP never."""
    rate: float = 0.0
    """Bytes per second of each connection; 0 for no limit."""
    queue: float = 65536.0
    """Bytes that may wait for `rate`: datagrams beyond are dropped, a TCP sender is made to wait."""
    loss: float = 0.0
    """Probability that a datagram is dropped; for TCP, that the transmission of a segment is, see
    `netem.relay.segments`."""
    reorder: float = 0.0
    """Probability that a datagram skips the delay and so overtakes those before it (udp only)."""

    def __post_init__(self) -> None:
        problems = list(self._problems())
        if problems:
            raise FaultsError("\n".join(problems))

    def _problems(self) -> Iterator[str]:
        for key, text in (
            ("delay", Plausible("a delay", 0.0, LONGEST_DELAY).objection(self.delay, "s")),
            ("jitter", Plausible("a jitter", 0.0, LONGEST_DELAY).objection(self.jitter, "s")),
            ("loss", Probability("a loss").objection(self.loss)),
            ("reorder", Probability("reordering").objection(self.reorder)),
        ):
            if text:
                yield f"{key}: {text}"
        if not (self.rate == 0.0 or 1.0 <= self.rate < float("inf")):
            yield f"rate: {self.rate:g} bytes/s; write at least 1, or 0 for no limit"
        if not self.queue >= 1500.0:
            yield f"queue: {self.queue:g} bytes do not hold one packet; write at least 1500"
        if self.jitter > self.delay:
            yield f"jitter: {self.jitter:g} s is more than the delay of {self.delay:g} s; nothing arrives early"
        if self.reorder > 0.0 and self.delay == 0.0:
            yield f"reorder: {self.reorder:g} needs a delay: without one there is nothing to overtake"

    def delayed(self, u: float) -> float:
        """Delay (s) for a number drawn uniformly from 0 to 1."""
        return self.delay + self.jitter * (2.0 * u - 1.0)

    def __str__(self) -> str:
        parts = []
        for field in fields(self):
            value = getattr(self, field.name)
            if value != field.default:
                parts.append(f"{field.name} {value:g}{UNITS[field.name]}")
        return ", ".join(parts) or "no fault"


UNITS = {"delay": " s", "jitter": " s", "rate": " bytes/s", "queue": " bytes", "loss": "", "reorder": ""}
"""Unit of each fault, as it is written behind the number."""
