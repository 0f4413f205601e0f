"""Whom an agent should hear and does not: the plant's roster beside what came over the own session. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

from agents.freerun.heard import Heard
from agents.freerun.hearing import Hearing
from agents.freerun.peers import Peers
from wire.messages import PLANT

SILENT = 1.0
"""Time (s, wall) without a message of the plant, or of a neighbour whom it hears, after which that one is silent."""


class RollCall:
    """Whether the agent's session brings what it should, one session after the other.

    Parameters
    ----------
    name : str
        The agent.
    heard : Heard
        When each was heard last.
    peers : Peers
        Who has been met, and who is a neighbour.
    """

    def __init__(self, name: str, heard: Heard, peers: Peers) -> None:
        self._name, self._heard, self._peers = name, heard, peers
        self._ran = False
        """Whether it has ever been in touch with a plant; before that, silence proves nothing."""
        self._hearing = Hearing()
        self._crossed: dict[str, tuple[str, float]] = {}
        """By sender: the owner of the other key under which its messages came, and the time of the last (s)."""
        self._seen = float("-inf")
        """When the plant was last known to be there, though it measures nothing yet (s)."""

    def next_session(self) -> None:
        """Begin anew, with the patience of the session that follows."""
        self._hearing = self._hearing.next()
        self._crossed.clear()

    def plant_seen(self, now: float) -> None:
        """Note that the plant is there (s): it has appeared, or says that it waits for agents."""
        self._seen = now

    def complaint(self, roster: Sequence[str] | None, now: float) -> str:
        """Note who is silent now; why a new session is needed, else nothing.

        Parameters
        ----------
        roster : Sequence[str] or None
            Whom the plant hears, as the last measurement says; None if there is none of late.
        now : float
            s on the own clock.
        """
        silent = self._silent(roster, now)
        self._hearing.whole |= roster is not None and not silent
        lost = self._hearing.lost(silent, now)
        for name in silent:
            key, at = self._crossed.get(name, ("", -inf))
            if self._ran and now - at <= SILENT:
                return f"messages of {name} come under the key of {key}"
        if lost in ("", PLANT):
            return lost and "nothing comes from the plant"
        if lost == self._name:
            return "the plant is heard, but does not hear this agent"
        return f"the plant hears {lost}, but nothing comes from it here"

    def crossed(self, name: str, key: str, now: float) -> None:
        """Note a message that came under another's key (s).

        By itself that proves nothing: anybody may publish it. But if its sender is silent under its own key, although
        the plant hears it, the key numbers of the session are confused: nobody else can bring that about, and it need
        not be waited for any longer.
        """
        self._crossed[name] = key, now

    def _silent(self, roster: Sequence[str] | None, now: float) -> tuple[str, ...]:
        """The plant, a neighbour that the plant hears, or oneself, by the plant."""
        if self._ran and min(self._heard.silence(PLANT, now), now - self._seen) > SILENT:
            return (PLANT,)
        if roster is None:
            return ()
        self._ran = True
        mute = () if self._name in roster else (self._name,)
        return *mute, *(name for name in roster if name != self._name and self._is_missing(name, now))

    def _is_missing(self, name: str, now: float) -> bool:
        if not self._peers.has_met(name):
            return True
        return name in self._peers.neighbours and self._heard.silence(name, now) > SILENT
