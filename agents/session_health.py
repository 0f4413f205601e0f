"""Detect a broken Zenoh session: agents that should be heard but are not, or an agent that nobody hears. Pure.

Each measurement lists the agents that the plant hears. If a neighbour on that list is silent here, or the agent itself
is not on it, the session fails (`gridpeers.wire.timing`).

Both ends of a link see that it fails, and one new session mends it: that of the agent for which most others are silent.
So an agent that misses no more than half of the others waits `STAGGER` longer, and again if the name of the one it
misses is smaller.

Times are s of real time on the agent's clock.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from math import inf

from gridpeers.wire.messages import PLANT
from gridpeers.wire.timing import SessionDeadline

SILENT = 1.0  # Time (s) without a message after which the plant, or a neighbour that the plant hears, counts as silent

STAGGER = 0.5
"""Time (s) between the agents that may open the new session, so that the first spares the others: one is heard after
0.1 s."""


class SessionHealth:
    """Judge whether the session brings the messages that it should; it outlives sessions."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._ran = False
        """Whether the agent has ever been in touch with a plant; before that, silence proves nothing."""
        self._plant_seen = -inf
        """Time (s) of the last sign of a plant that does not measure yet."""
        self._patience = SessionDeadline()
        self._came: dict[str, float] = {}

    def next_session(self) -> None:
        self._patience = self._patience.next()
        self._came.clear()

    def came(self, name: str, now: float) -> None:
        self._came[name] = now

    def has_come(self, name: str) -> bool:
        return name in self._came

    def forget(self, name: str) -> None:
        self._came.pop(name, None)

    def plant_seen(self, now: float) -> None:
        self._plant_seen = now

    def problem(
        self, roster: Sequence[str] | None, *, met: Collection[str], neighbours: Collection[str], now: float
    ) -> str:
        """Return the reason why a new session is needed; "" if none is.

        `roster` has the agents that the plant hears, as the last measurement says, None if there is no recent one;
        `met` those whose nameplate is known, and `neighbours` those of them that the agent listens to.
        """
        own = self._name
        # Something must come of neighbours, and of those of which nothing is known.
        others = [name for name in roster or () if name != own and (name not in met or name in neighbours)]
        silent = self._silent(roster, others, now)
        self._patience.whole |= roster is not None and not silent
        waits = {  # how much longer (s) each is waited for, so that one agent goes first
            name: 0.0 if name in (PLANT, own) or 2 * len(silent) > len(others) else STAGGER * (1 + (name < own))
            for name in silent
        }
        lost = self._patience.lost(waits, now)
        if lost in ("", PLANT):
            return lost and "nothing comes from the plant"
        if lost == own:
            return "the plant is heard, but does not hear this agent"
        return f"the plant hears {lost}, but nothing comes from it here"

    def _silent(self, roster: Sequence[str] | None, others: Sequence[str], now: float) -> tuple[str, ...]:
        """Return the silent names: the plant, agents that it hears, or this agent if it is not heard there."""
        if self._ran and now - max(self._came.get(PLANT, -inf), self._plant_seen) > SILENT:
            return (PLANT,)
        if roster is None:
            return ()
        self._ran = True
        unheard = () if self._name in roster else (self._name,)
        return *unheard, *(name for name in others if now - self._came.get(name, -inf) > SILENT)
