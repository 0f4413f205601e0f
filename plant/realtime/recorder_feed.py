"""Telemetry for the recorders of a run: published, kept, and published again for one that was out of reach. Pure."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable

from gridpeers.plant.telemetry_reporter import KeptTelemetry

KEPT_BYTES, KEPT_BYTES_RECORDED = 4_000_000, 40_000_000
"""Bytes that are kept, without and with journals: two minutes of nine inverters at real time."""

AT_ONCE = 20  # messages that are published again in one control period, so that the plant keeps its pace


class RecorderFeed(KeptTelemetry):
    """The latest telemetry, and the recorders that the run waits for.

    While messages are published again, new ones wait for their turn: a recorder gets all in order.
    """

    def __init__(self, needed: Iterable[str], publish: Callable[[bytes], None], limit: int = KEPT_BYTES) -> None:
        super().__init__()
        self._needed, self._publish, self._limit = frozenset(needed), publish, limit
        self._due: deque[tuple[int, memoryview]] = deque()
        self._out_of_reach: set[str] = set()  # recorders whose token went while the run went on
        self.paced = False  # whether `replay` publishes a little in each period; else all goes at once

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
        self.keep(number, payload)
        while self.bytes > self._limit and self._kept[0][0] < number:
            self.drop_before(self._kept[0][0] + 1)
        if not self._due:
            self._publish(payload)
            return
        self._due.append(self._kept[-1])
        if not self.paced:
            self.replay()

    def again_from(self, number: int) -> int:
        """Have messages from a number on published again; return the first number that is still kept."""
        start = min(number, self._due[0][0]) if self._due else number
        self._due = deque(entry for entry in self._kept if entry[0] >= start)
        return max(number, self._kept[0][0]) if self._kept else number

    def replay(self) -> None:
        for _ in range(min(AT_ONCE, len(self._due)) if self.paced else len(self._due)):
            self._publish(bytes(self._due.popleft()[1]))

    def end(self) -> None:
        self.paced = False
        self.replay()
