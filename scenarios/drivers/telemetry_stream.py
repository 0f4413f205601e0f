"""The plant's telemetry in order and without gaps: the missing messages, and the time to ask for them again. Pure.

A recorder that stands still for longer than Zenoh's lease loses its link, and with it messages on the way. The plant
keeps its latest messages (`gridpeers.plant.realtime.kept_telemetry`) and publishes them again when asked by a
`Command`. In simulated time the same question acknowledges all before its number
(`gridpeers.plant.unacknowledged_telemetry`): it is sent after each Telemetry, and again and again until the next.
"""

from __future__ import annotations

from gridpeers.wire.messages import Answer, Journal, LinkReport, LinkRequest, Telemetry

QUIET = 1.5
"""Time (s) without a message of a running plant after which it is asked; it reports five times a second."""

AGAIN = 1.0
"""Time (s) between two questions."""

ASTRAY = 3.0
"""Time (s) without any answer after which a new session is opened; twice as long after each that brought none."""

ASTRAY_SIMULATED = 10.0
"""The same in simulated time, where a plant answers between two steps, or once a full link of its is closed."""

LONGEST = 60.0
"""Longest such time (s)."""


Recordable = Telemetry | LinkReport | Journal | LinkRequest
"""Messages that the plant publishes for recorders."""


class TelemetryStream:
    """Let messages through in the order in which the plant published them, each once.

    Parameters
    ----------
    acknowledges : bool, optional
        Whether the plant waits for acknowledgements, as in simulated time.

    Attributes
    ----------
    lost : bool
        Whether messages are lost, as the plant did not have them any more.

    Examples
    --------
    >>> def telemetry(seq):
    ...     return Telemetry(sender="plant", epoch=1, seq=seq, t=0.0, inverters=(), rows=(), events=(),
    ...         final=False, outcome="", reproducible=False)
    >>> stream = TelemetryStream()
    >>> [len(stream.take(telemetry(seq), now=0.0)) for seq in (0, 1, 3)], stream.question(now=0.0)
    ([1, 1, 0], '2')
    >>> stream.answered(Answer(sender="plant", epoch=1, seq=0, t=0.0, ok=True, text="2"), now=0.1)
    >>> [len(stream.take(telemetry(seq), now=0.1)) for seq in (2, 3, 3, 4)], stream.question(now=0.2)
    ([1, 1, 0, 1], None)
    """

    def __init__(self, *, acknowledges: bool = False) -> None:
        self.acknowledges = acknowledges
        self.lost = False
        self._next = 0
        """Number of the next Telemetry."""
        self._held: list[Recordable] = []
        """Other messages that came since the one before: with the next they are known to be in order."""
        self._gap_since: float | None = None
        """Time (s) since which messages are dropped, until the plant answers with the first number that comes again."""
        self._heard_at: float | None = None
        self._asked_at = self._opened_at = float("-inf")
        self._over = False
        self._patience = self._shortest = ASTRAY_SIMULATED if acknowledges else ASTRAY
        self._acknowledged = -1
        """Number in the last question."""

    def take(self, message: Recordable, now: float) -> list[Recordable]:
        """Note a message (s, monotonic); return the messages that can be recorded now, in order."""
        self._heard_at = now
        if self._gap_since is not None:
            return []  # it comes again, in its order
        if not isinstance(message, Telemetry):
            self._held.append(message)
            return []
        held, self._held = self._held, []
        if message.seq < self._next:
            return []
        if message.seq > self._next or len(held) < message.others:
            self._gap_since, self._asked_at = now, float("-inf")
            return []
        self._next += 1
        self._over = message.final
        return [*held, message]

    def answered(self, answer: Answer, now: float) -> None:
        """Note the plant's answer: the number from which on it publishes again."""
        if answer.ok and answer.text.isascii() and answer.text.isdigit():
            self._heard_at, self._patience, self._gap_since = now, self._shortest, None
            self._held.clear()
            if int(answer.text) > self._next:
                self.lost, self._next = True, int(answer.text)

    def question(self, now: float) -> str | None:
        """Return the number of the first Telemetry to be published again, if the plant is to be asked for it now."""
        if self.acknowledges:
            if self._next == self._acknowledged and now - self._asked_at < AGAIN:
                return None
            self._acknowledged, self._asked_at = self._next, now
            return str(self._next)
        if self._heard_at is None or self._over or now - self._asked_at < AGAIN:
            return None
        if self._gap_since is None:
            if now - self._heard_at < QUIET:
                return None
            self._gap_since = now
            self._held.clear()
        self._asked_at = now
        return str(self._next)

    def is_astray(self, now: float) -> bool:
        """Return whether a new session is to be opened now, as questions have had no answer for long."""
        since = self._heard_at if self.acknowledges else self._gap_since
        if since is None or now - max(since, self._opened_at) < self._patience:
            return False
        self._opened_at, self._patience = now, min(2.0 * self._patience, LONGEST)
        return True
