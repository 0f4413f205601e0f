"""The statuses of agents in a closed loop: the plant hears one whenever it heard one in the record."""

from __future__ import annotations

from collections import deque

from gridpeers.lab.replay.replayed_process import Message

KEPT = 16
"""Latest statuses of an agent that are kept, of some seconds: one may be long on its way."""


class SentStatuses:
    """Statuses that the agents of the replay have sent.

    Examples
    --------
    >>> statuses = SentStatuses()
    >>> for payload in (b"first", b"second"):
    ...     statuses.sent(Message("status/inv1", payload))

    Without a change, the status of the record is among them. Under a change it is not; then the latest one is heard:

    >>> [statuses.as_sent(Message("status/inv1", payload)).payload for payload in (b"first", b"another")]
    [b'first', b'second']
    >>> statuses.as_sent(Message("status/inv2", b"of an agent that is as recorded")).payload
    b'of an agent that is as recorded'
    """

    def __init__(self) -> None:
        self._sent: dict[str, deque[Message]] = {}

    def sent(self, message: Message) -> None:
        """Note a status that an agent sends."""
        self._sent.setdefault(message.key, deque(maxlen=KEPT)).append(message)

    def as_sent(self, recorded: Message) -> Message:
        """Return what the plant hears when it heard a status in the record."""
        known = self._sent.get(recorded.key)
        return recorded if not known or recorded in known else known[-1]
