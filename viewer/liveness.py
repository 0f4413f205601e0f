"""Whether the numbers of a run are of now: live, frozen, gone or ended. Pure."""

from __future__ import annotations

from typing import Literal

import msgspec

FROZEN = 0.7
"""Time (s) without telemetry after which a plant that is there counts as frozen: it publishes five times a second."""

Word = Literal["waiting", "live", "frozen", "gone", "ended", "record"]


class LivenessView(msgspec.Struct, frozen=True, kw_only=True):
    """The state of a run as the page shows it."""

    word: Word
    text: str
    """In a sentence."""
    since: float | None = None
    """How long ago (s) the last word of the plant came, if that is not now."""
    restarts: int = 0
    """Other plants that have taken up the run since the view began."""


class Liveness:
    """Decide from tokens and telemetry whether numbers are of now.

    Examples
    --------
    >>> liveness = Liveness()
    >>> liveness.at(0.0).word
    'waiting'
    >>> liveness.heard(1, 1.0, ended=None)
    False
    >>> liveness.token(there=True, now=1.0)
    >>> liveness.at(1.1).word, liveness.at(3.0).text
    ('live', 'The plant has been silent for 2.0 s: frozen, or out of reach.')
    >>> liveness.token(there=False, now=3.0)
    >>> liveness.at(3.5).text
    'The plant is gone; its last word came 2.5 s ago.'
    >>> liveness.heard(2, 4.0, ended=None), liveness.at(4.0).word, liveness.at(4.0).restarts
    (True, 'live', 1)
    """

    def __init__(self) -> None:
        self._epoch: int | None = None
        self._heard_at: float | None = None
        self._gone_at: float | None = None
        self._end: str | None = None
        self._restarts = 0

    def heard(self, epoch: int, now: float, *, ended: str | None) -> bool:
        """Note telemetry of a plant; `ended` is why its run ended, if it did. Return whether another plant sent it."""
        another = self._epoch is not None and epoch != self._epoch
        self._restarts += another
        self._epoch, self._heard_at, self._end, self._gone_at = epoch, now, ended, None
        return another

    def token(self, *, there: bool, now: float) -> None:
        """Note whether the plant's token is there (now is the client's clock, s)."""
        if there:
            self._gone_at = None
        elif self._gone_at is None:
            self._gone_at = now

    def at(self, now: float) -> LivenessView:
        """Return the state at a time (s)."""
        silent = None if self._heard_at is None else now - self._heard_at
        if self._end is not None:
            return self._view("ended", f"The run has ended{': ' + self._end if self._end else ''}.", silent)
        if self._gone_at is not None and silent is not None:
            return self._view("gone", f"The plant is gone; its last word came {silent:.1f} s ago.", silent)
        if silent is None:
            return self._view("waiting", "The run has not begun: the plant waits for its agents.", None)
        if silent > FROZEN:
            return self._view(
                "frozen", f"The plant has been silent for {silent:.1f} s: frozen, or out of reach.", silent
            )
        return self._view("live", "live", None)

    def _view(self, word: Word, text: str, since: float | None) -> LivenessView:
        again = f" The plant was restarted {self._restarts} times." if self._restarts and word != "live" else ""
        return LivenessView(
            word=word,
            text=text + again,
            since=None if since is None else round(since, 1),
            restarts=self._restarts,
        )
