"""Whether an agent hears whom it should, and is heard: what a session that has gone astray is known by. Pure.

After a cut that heals just as Zenoh's lease runs out, Zenoh can add the new link to a transport of which the other side
has closed its end: messages then go astray for good. And a link between two agents that ended while both kept theirs to
the plant is not made again by anybody. Both are seen from outside only: the plant hears a neighbour that the agent does
not, or does not hear the agent itself. A new session has a new id, for which nobody keeps a stale end of a link.
"""

from __future__ import annotations

from collections.abc import Iterable

PATIENCE = 3.5
"""Time (s, wall) that somebody has not been heard who should be, after which the session is opened anew. Longer than
Zenoh's lease, after which the others have forgotten the old one. Doubled, to `LONGEST`, for a session that comes after
one in which nothing was ever as it should be."""

LONGEST = 60.0
"""Longest patience (s, wall): a path that stays cut must not keep an agent busy with sessions."""


class Hearing:
    """Whether the session brings what it should.

    Parameters
    ----------
    patience : float, optional
        Longest silence (s, wall).

    Examples
    --------
    >>> hearing = Hearing(3.5)
    >>> [hearing.lost(names, now) for names, now in [(("inv2", "inv3"), 0.0), (("inv3",), 3.0), (("inv3",), 3.5)]]
    ['', '', 'inv3']
    """

    def __init__(self, patience: float = PATIENCE) -> None:
        self.whole = False
        """Whether everybody was heard who should be, and oneself, at some time of this session."""
        self._patience = patience
        self._since: dict[str, float] = {}

    def next(self) -> Hearing:
        """That of the next session: more patient, if this one never was whole.

        Examples
        --------
        >>> hearing = Hearing(3.5).next()
        >>> hearing.lost(("inv3",), 0.0), hearing.lost(("inv3",), 6.9), hearing.lost(("inv3",), 7.0)
        ('', '', 'inv3')
        """
        return Hearing(PATIENCE if self.whole else min(2.0 * self._patience, LONGEST))

    def lost(self, silent: Iterable[str], now: float) -> str:
        """Note who is silent now and should not be; the first of whom this has lasted too long, else nothing."""
        self._since = {name: self._since.get(name, now) for name in silent}
        return next((name for name, since in self._since.items() if now - since >= self._patience), "")
