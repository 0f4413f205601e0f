"""Decide when a broken Zenoh session needs a new one. Pure; times are s of wall time.

After a cut that heals just as Zenoh's lease runs out, Zenoh can add the new link to a transport whose other end
is closed: all its messages are lost. And Zenoh does not renew a link between two agents that ended while both kept
theirs to the plant. Both faults show from outside only: a sender is silent here although others hear it. A new session
has a new id, for which no peer keeps a stale end of a link.
"""

from __future__ import annotations

from collections.abc import Mapping

PATIENCE = 3.5
"""Silence (s) after which a new session opens. It is longer than Zenoh's lease, after which the others have
forgotten the old session. It doubles, up to `LONGEST`, after a session that never worked."""

LONGEST = 60.0
"""Longest patience (s): a path that stays cut must not keep a process busy with sessions."""


class SessionDeadline:
    """Measure how long each sender has been silent in this session.

    Parameters
    ----------
    patience : float, optional
        Longest silence (s).

    Examples
    --------
    >>> patience = SessionDeadline(3.5)
    >>> both, one = {"inv2": 0.0, "inv3": 0.0}, {"inv3": 0.0}
    >>> [patience.lost(names, now) for names, now in [(both, 0.0), (one, 3.0), (one, 3.5)]]
    ['', '', 'inv3']
    """

    def __init__(self, patience: float = PATIENCE) -> None:
        self.whole = False
        """Whether no sender was silent at some time of this session."""
        self._patience = patience
        self._since: dict[str, float] = {}

    def next(self) -> SessionDeadline:
        """Return the patience of the next session: twice as long if this session never worked.

        Examples
        --------
        >>> patience, silent = SessionDeadline(3.5).next(), {"inv3": 0.0}
        >>> patience.lost(silent, 0.0), patience.lost(silent, 6.9), patience.lost(silent, 7.0)
        ('', '', 'inv3')
        """
        return SessionDeadline(PATIENCE if self.whole else min(2.0 * self._patience, LONGEST))

    def lost(self, silent: Mapping[str, float], now: float) -> str:
        """Note the senders that are wrongly silent now; return the first that has been so too long, else "".

        Parameters
        ----------
        silent : Mapping[str, float]
            Each silent sender, with the time (s) by which it may be silent longer than the patience.
        now : float
            s of wall time.
        """
        self._since = {name: self._since.get(name, now) for name in silent}
        return next(
            (name for name, since in self._since.items() if now - since >= self._patience + silent[name]),
            "",
        )
