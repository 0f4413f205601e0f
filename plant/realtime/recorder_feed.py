"""Telemetry for the recorders of a run: published, kept, and published again for one that was out of reach. Pure."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from typing import NamedTuple

KEPT_BYTES, KEPT_BYTES_RECORDED = 4_000_000, 40_000_000
"""Bytes that are kept, without and with journals: two minutes of nine inverters at real time, a part of the
process's memory."""

AT_ONCE = 20  # messages that are published again in one control period, so that the plant keeps its pace


BLOCK = 1 << 20
"""Bytes of a block that messages are copied into. Kept one by one among all else, they would leave a heap full of
holes: a plant grew by 35 MB in five minutes, with nothing more in use than before."""


class _Entry(NamedTuple):
    number: int  # number of the Telemetry that it counts to
    block: bytearray
    start: int
    end: int

    @property
    def payload(self) -> bytes:
        return bytes(self.block[self.start : self.end])


class KeptTelemetry:
    """The latest messages on the key of telemetry, in their order.

    Each message has the number of the next or same Telemetry: messages between two of them count to the later one.
    While messages are published again, new ones wait for their turn: a recorder gets all in order.
    """

    def __init__(self, limit: int = KEPT_BYTES) -> None:
        self._limit, self._bytes = limit, 0
        self._kept: deque[_Entry] = deque()
        self._due: deque[_Entry] = deque()
        self._block, self._filled = bytearray(), 0
        self._spare: list[bytearray] = []  # blocks to be filled again
        self._latest, self._count = 0, 0

    def add(self, number: int, payload: bytes) -> bool:
        """Keep a message; return whether it is to be published now, and not after those that are published again."""
        self._latest, self._count = number, self.others(number) + 1
        entry = self._stored(number, payload)
        self._kept.append(entry)
        self._bytes += len(payload)
        while self._bytes > self._limit and self._kept[0].number < number:  # what counts to one Telemetry goes together
            gone = self._kept[0].number
            while self._kept[0].number == gone:
                self._drop()
        if self._due:
            self._due.append(entry)
            return False
        return True

    def _stored(self, number: int, payload: bytes) -> _Entry:
        size = len(payload)
        if self._filled + size > len(self._block):
            fits = self._spare and size <= BLOCK
            self._block, self._filled = self._spare.pop() if fits else bytearray(max(BLOCK, size)), 0
        start = self._filled
        self._filled = start + size
        self._block[start : self._filled] = payload
        return _Entry(number, self._block, start, self._filled)

    def _drop(self) -> None:
        """Forget the oldest message; its block can be filled again once nothing in it is kept, or to be published."""
        entry = self._kept.popleft()
        self._bytes -= entry.end - entry.start
        if self._kept[0].block is not entry.block and not self._due and len(entry.block) == BLOCK:
            self._spare.append(entry.block)

    def others(self, number: int) -> int:
        """Return the number of messages that count to a Telemetry that is yet to be kept."""
        return self._count if number == self._latest else 0

    def again_from(self, number: int) -> int:
        """Have messages from a number on published again; return the first number that is still kept."""
        start = min(number, self._due[0].number) if self._due else number
        self._due = deque(entry for entry in self._kept if entry.number >= start)
        return max(number, self._kept[0].number) if self._kept else number

    def take(self, count: int = AT_ONCE) -> list[bytes]:
        return [self._due.popleft().payload for _ in range(min(count, len(self._due)))]

    def take_all(self) -> list[bytes]:
        return self.take(len(self._due))


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
        for payload in self.kept.take() if self.paced else self.kept.take_all():
            self._publish(payload)

    def end(self) -> None:
        self.paced = False
        self.replay()
