"""Telemetry for the recorders of a run: published, kept, and published again for one that was out of reach. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from gridpeers.plant.realtime.kept_telemetry import KEPT_BYTES, KeptTelemetry


class RecorderFeed:
    """The recorders that the run waits for, and what is published for them.

    Parameters
    ----------
    needed : Iterable[str]
        Names of the recorders that the run waits for.
    publish : Callable[[bytes], None]
        Publishes bytes on the key of telemetry.
    limit : int, optional
        Bytes that are kept.
    """

    def __init__(self, needed: Iterable[str], publish: Callable[[bytes], None], limit: int = KEPT_BYTES) -> None:
        self._needed, self._publish = frozenset(needed), publish
        self._out_of_reach: set[str] = set()
        """Recorders whose token went while the run went on, and has not come back."""
        self.kept = KeptTelemetry(limit)
        """Messages that recorders can have again."""
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
        """Publish again what is due."""
        for payload in self.kept.take() if self.paced else self.kept.take_all():
            self._publish(payload)

    def end(self) -> None:
        """Publish again all that is due, as the run ends."""
        self.paced = False
        self.replay()
