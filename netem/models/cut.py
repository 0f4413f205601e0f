"""A link that is down."""

from __future__ import annotations

import msgspec


class Cut(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Nothing passes as long as the entry holds; in a file `cut = true` says the same."""

    hold: bool = False
    """False: messages are lost, reason "cut". True: they are kept, and all go on when the cut ends."""

    def down_until(self, t: float, from_s: float, to_s: float) -> float | None:
        """Until when the link is down at t (s of run time), None if it is up."""
        return to_s if from_s <= t < to_s else None
