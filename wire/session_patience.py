"""How long a Zenoh session may fail to bring what it should, before a new one is opened. Pure; times are s, wall.

After a cut that heals just as Zenoh's lease runs out, Zenoh can add the new link to a transport of which the other side
has closed its end: messages then go astray for good. And a link between two agents that ended while both kept theirs to
the plant is not made again by anybody. Both show from outside only: somebody is silent whom others hear. A new session
has a new id, for which nobody keeps a stale end of a link.
"""

from __future__ import annotations

from collections.abc import Iterable

PATIENCE = 3.5
"""Time (s) of silence after which a new session is opened. Longer than Zenoh's lease, after which the others have
forgotten the old one. Doubled, to `LONGEST`, for a session that follows one in which nothing was ever as it should
be."""

LONGEST = 60.0
"""Longest patience (s): a path that stays cut must not keep a process busy with sessions."""


class SessionPatience:
    """Since when each sender has been silent in this session.

    Parameters
    ----------
    patience : float, optional
        Longest silence (s).

    Examples
    --------
    >>> patience = SessionPatience(3.5)
    >>> [patience.lost(names, now) for names, now in [(("inv2", "inv3"), 0.0), (("inv3",), 3.0), (("inv3",), 3.5)]]
    ['', '', 'inv3']
    """

    def __init__(self, patience: float = PATIENCE) -> None:
        self.whole = False
        """Whether everything came that should, at some time of this session."""
        self._patience = patience
        self._since: dict[str, float] = {}

    def next(self) -> SessionPatience:
        """Return that of the next session: twice as long, if this session never was whole.

        Examples
        --------
        >>> patience = SessionPatience(3.5).next()
        >>> patience.lost(("inv3",), 0.0), patience.lost(("inv3",), 6.9), patience.lost(("inv3",), 7.0)
        ('', '', 'inv3')
        """
        return SessionPatience(PATIENCE if self.whole else min(2.0 * self._patience, LONGEST))

    def lost(self, silent: Iterable[str], now: float) -> str:
        """Note who is silent now and should not be; return the first of whom this has lasted too long, else ""."""
        self._since = {name: self._since.get(name, now) for name in silent}
        return next((name for name, since in self._since.items() if now - since >= self._patience), "")
