"""Telemetry for the recorders of a run: published, kept, and published again for one that was out of reach. Pure."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable

from gridpeers.plant.telemetry_reporter import count_last

KEPT_BYTES, KEPT_BYTES_RECORDED = 4_000_000, 40_000_000
"""Bytes that are kept, without and with journals: two minutes of nine inverters at real time, a part of the
process's memory."""

AT_ONCE = 20  # messages that are published again in one control period, so that the plant keeps its pace


class KeptTelemetry:
    """The latest messages on the key of telemetry, in their order.

    Each message has the number of the next or same Telemetry: messages between two of them count to the later one.
    While messages are published again, new ones wait for their turn: a recorder gets all in order.
    """

    def __init__(self, limit: int = KEPT_BYTES) -> None:
        self._limit, self._bytes = limit, 0
        self._kept: deque[tuple[int, bytes]] = deque()
        self._due: deque[tuple[int, bytes]] = deque()

    def add(self, number: int, payload: bytes) -> bool:
        """Keep a message; return whether it is to be published now, and not after those that are published again."""
        self._kept.append((number, payload))
        self._bytes += len(payload)
        while self._bytes > self._limit and self._kept[0][0] < number:  # what counts to one Telemetry goes together
            gone = self._kept[0][0]
            while self._kept[0][0] == gone:
                self._bytes -= len(self._kept.popleft()[1])
        if self._due:
            self._due.append((number, payload))
            return False
        return True

    def others(self, number: int) -> int:
        """Return the number of messages that count to a Telemetry that is yet to be kept."""
        return count_last(self._kept, number)

    def again_from(self, number: int) -> int:
        """Have messages from a number on published again; return the first number that is still kept."""
        start = min(number, self._due[0][0]) if self._due else number
        self._due = deque(entry for entry in self._kept if entry[0] >= start)
        return max(number, self._kept[0][0]) if self._kept else number

    def take(self, count: int | None = AT_ONCE) -> list[bytes]:
        """Take out the messages to publish again now; None: all of them, as the run ends."""
        return [self._due.popleft()[1] for _ in range(len(self._due) if count is None else min(count, len(self._due)))]


class RecorderFeed:
    """The recorders that the run waits for, and what is published for them."""

    def __init__(self, needed: Iterable[str], publish: Callable[[bytes], None], limit: int = KEPT_BYTES) -> None:
        self._needed, self._publish = frozenset(needed), publish
        self._out_of_reach: set[str] = set()
        """Recorders whose token went while the run went on, and has not come back."""
        self.kept = KeptTelemetry(limit)  # messages that recorders can have again
        self.paced = False
        """Whether the plant keeps pace, so that `replay` publishes a little in each period; else all goes at once."""

    @property
    def complete(self) -> bool:
        """Whether no recorder is out of reach; one that is may yet come for what it has missed."""
        return not self._out_of_reach

    def awaits(self, present: Iterable[str]) -> bool:
        """Return whether a recorder is out of reach, or present; one leaves once it has the whole run."""
        return not self._needed.isdisjoint(self._out_of_reach.union(present))

    def came(self, name: str) -> str:
        """Note a recorder's token; return a sentence if it was out of reach."""
        if name not in self._out_of_reach:
            return ""
        self._out_of_reach.discard(name)
        return f"recorder {name} is back"

    def gone(self, name: str) -> str:
        """Note that a recorder's token went while the run goes on; return a sentence if the run needs it."""
        if name not in self._needed:
            return ""
        self._out_of_reach.add(name)
        return f"recorder {name} is out of reach; what it misses is kept for a while"

    def publish(self, number: int, payload: bytes) -> None:
        """Publish and keep a message of this number; it waits if others before it are published again."""
        if self.kept.add(number, payload):
            self._publish(payload)
        elif not self.paced:
            self.replay()

    def replay(self) -> None:
        for payload in self.kept.take(AT_ONCE if self.paced else None):
            self._publish(payload)

    def end(self) -> None:
        self.paced = False
        self.replay()
