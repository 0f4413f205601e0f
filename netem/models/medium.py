"""Media that let messages wait: a line of finite rate with a finite queue before it, and time slots."""

from __future__ import annotations

import math
from typing import Annotated

import msgspec

from netem.models import INSTANT
from wire.schema.plausible import Plausible, Unit
from wire.schema.table_schema import Problem


class Rate(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    r"""First in, first out, what does not fit is dropped at the tail, reason "queue".

    A message of b bytes that comes at time t, when the line is busy until T, finds :math:`q = \max(0, (T - t) R)` bytes
    not yet sent. It goes if q is 0 or if q + b fits the queue, and is through at :math:`\max(t, T) + b / R`.
    """

    bytes_per_s: Annotated[
        float, Unit("bytes/s"), Plausible("a rate", 1.0, 1e11, hint="; it is in bytes, not bits, per second")
    ]
    """R (bytes per second). A line of 9.6 kbit/s has 1200."""
    queue_bytes: Annotated[int, Unit("bytes"), Plausible("a queue", 1, 1e9)] = 10_000
    """Most bytes that may wait, the message being sent included; an idle line takes any message."""

    def through(self, ready: float, busy_until: float, size: int) -> float | None:
        """Return when the message's last byte is sent (s, as the others), None if the queue is full.

        Examples
        --------
        >>> line = Rate(bytes_per_s=1000.0, queue_bytes=250)
        >>> line.through(0.0, 0.0, 100), line.through(0.0, 0.1, 100), line.through(0.0, 0.2, 100)
        (0.1, 0.2, None)
        """
        waiting = (busy_until - ready) * self.bytes_per_s
        if waiting <= 0.0:
            return ready + size / self.bytes_per_s
        # a millionth of a byte is what the times' last digits are worth
        if waiting + size > self.queue_bytes + 1e-6:
            return None
        return busy_until + size / self.bytes_per_s


class Slots(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Slot n lasts from offset_s + n period_s for length_s; a message outside waits for the next one.

    Times are run time, so that links with different offsets share a medium. A slot has room for any number of messages;
    give a rate as well where it has not.
    """

    period_s: Annotated[float, Unit("s"), Plausible("the period of slots", 0.0, 10.0, above_zero=True)]
    """Distance of the slots' beginnings (s)."""
    offset_s: Annotated[float, Unit("s"), Plausible("the offset of slots", 0.0, 10.0)] = 0.0
    """Beginning of the first slot (s), below period_s."""
    length_s: Annotated[float, Unit("s"), Plausible("the length of a slot", 0.0, 10.0, above_zero=True)]
    """Length of a slot (s), up to period_s."""

    def opens(self, ready: float) -> float:
        """Return when a message that is ready goes (s of run time).

        Examples
        --------
        >>> slots = Slots(period_s=1.0, offset_s=0.25, length_s=0.125)
        >>> slots.opens(0.0), slots.opens(0.3), slots.opens(0.375), slots.opens(1.25)
        (0.25, 0.3, 1.25, 1.25)
        """
        number = math.floor((ready - self.offset_s) / self.period_s + INSTANT / self.period_s)
        if ready < self.offset_s + number * self.period_s + self.length_s - INSTANT:
            return ready
        return max(self.offset_s + (number + 1) * self.period_s, ready)

    def relations(self) -> list[Problem]:
        """Return contradictions between its values."""
        problems = []
        for key in ("offset_s", "length_s"):
            value = getattr(self, key)
            if value > self.period_s or (key == "offset_s" and value == self.period_s):
                text = f"{value:g} s does not go with period_s = {self.period_s:g} s: slots repeat with the period"
                problems.append(Problem(key, text))
        return problems
