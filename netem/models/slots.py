"""Messages go only in the link's own time slots (TDMA, as on power lines and some radios)."""

from __future__ import annotations

import math
from typing import Annotated

import msgspec

from netem.models.instant import INSTANT
from wire.plausible import Plausible, Unit
from wire.table_schema import Problem


class Slots(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Slot n lasts from offset_s + n period_s for length_s; what comes outside waits for the next one.

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
        """When a message that is ready goes (s of run time).

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
        """Return what its values ask of each other."""
        found = []
        for key in ("offset_s", "length_s"):
            value = getattr(self, key)
            if value > self.period_s or (key == "offset_s" and value == self.period_s):
                text = f"{value:g} s does not go with period_s = {self.period_s:g} s: slots repeat with the period"
                found.append(Problem(key, text))
        return found
