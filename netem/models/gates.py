"""Links that are down: for the time of an entry, or up and down in turn."""

from __future__ import annotations

import math
from typing import Annotated

import msgspec

from wire.schema.plausible import Plausible, Unit

LONGEST_FLAP = 600.0
"""Longest plausible up or down time (s)."""


class Cut(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Nothing passes as long as the entry holds; in a file `cut = true` says the same."""

    hold: bool = False
    """False: messages are lost, reason "cut". True: they are kept, and all go on when the cut ends."""

    def down_until(self, t: float, from_s: float, to_s: float) -> float | None:
        """Return until when the link is down at t (s of run time), None if it is up."""
        return to_s if from_s <= t < to_s else None


class Flap(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Up for up_s, down for down_s, and so on, beginning with up at the entry's from_s."""

    up_s: Annotated[float, Unit("s"), Plausible("the up time of a flap", 0.0, LONGEST_FLAP, above_zero=True)]
    """How long the link is up (s)."""
    down_s: Annotated[float, Unit("s"), Plausible("the down time of a flap", 0.0, LONGEST_FLAP, above_zero=True)]
    """How long it is down (s)."""
    hold: bool = False
    """False: messages are lost while it is down, reason "flap". True: they are kept, and go on when it is up."""

    def down_until(self, t: float, from_s: float, to_s: float) -> float | None:
        """Return until when the link is down at t (s of run time), None if it is up."""
        if not from_s <= t < to_s:
            return None
        period = self.up_s + self.down_s
        number = math.floor((t - from_s) / period)
        end = from_s + (number + 1) * period
        if t < end - self.down_s:
            return None
        return min(end, to_s)
