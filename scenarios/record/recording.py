"""The record of one case under way: which message of the run goes to which channel, and what viewers of MCAP get."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import msgspec

from gridpeers.scenarios.record.record_info import FILE, TOPICS, RecordInfo, channels
from gridpeers.scenarios.record.record_writer import RecordWriter
from gridpeers.wire.codec import payload_of
from gridpeers.wire.messages import Journal, LinkReport, LinkRequest, PlantEvent, Telemetry

NANO = 1_000_000_000

VIEW_STEP, LIVE_VIEW_STEP = 0.2, 0.05
"""Least distance (s) of the rows that viewers get in simulated time, where each takes as long as a decision, and in
real time, where they take a quarter of the file at 0.01 s. All rows are in the telemetry."""


def nanoseconds(t: float) -> int:
    """Return a run time (s) as time in a record: whole nanoseconds since t = 0."""
    return round(t * NANO)


def row_json(row: Sequence[float], inverters: Sequence[str], quantities: Sequence[str]) -> bytes:
    """Return a row of telemetry as JSON; null stands for a number that is not finite.

    Examples
    --------
    >>> row_json((0.02, 60.0, float("nan")), ["inv1"], ["f_Hz", "P_W"])
    b'{"t_s":0.02,"inv1":{"f_Hz":60.0,"P_W":null}}'
    """
    t, *values = row
    number = len(quantities)
    parts = (values[i : i + number] for i in range(0, len(values), number))
    named = {name: dict(zip(quantities, part, strict=True)) for name, part in zip(inverters, parts, strict=True)}
    return msgspec.json.encode({"t_s": t} | named)


def event_json(event: PlantEvent) -> bytes:
    """Return an event as a `foxglove.Log`, which viewers list."""
    at = nanoseconds(event.t)
    log = {
        "timestamp": {"sec": at // NANO, "nsec": at % NANO},
        "level": 3 if event.kind == "warning" else 2,
        "message": event.text,
        "name": event.kind,
        "file": event.subject,
        "line": 0,
    }
    return msgspec.json.encode(log)


class Recording:
    """Record one case: give it all that the plant publishes for recorders, then close it.

    Raise OSError if the file cannot be made.
    """

    def __init__(self, folder: Path, info: RecordInfo, quantities: Sequence[str]) -> None:
        self._writer = RecordWriter(folder / FILE, info, channels(info.inverters, tuple(quantities)))
        self._quantities = quantities
        self._step = nanoseconds(LIVE_VIEW_STEP if info.clock == "wall" else VIEW_STEP)
        self._t = self._next = 0.0
        """Time (s) of the last telemetry, and from which on a row is the next for viewers."""

    @property
    def failure(self) -> str:
        """Sentence on why the record ended early; empty if it did not."""
        writer = self._writer
        if not writer.failure:
            return ""
        return f"the record {writer.path.name} ends at {writer.ended / 1e9:.2f} s: {writer.failure}"

    def __call__(self, message: Telemetry | Journal | LinkReport | LinkRequest) -> None:
        """Record a message of the plant for recorders; reports on links have no time of their own."""
        if isinstance(message, Telemetry):
            self._t = message.t
        at = nanoseconds(self._t if isinstance(message, LinkReport) else message.t)
        self._writer.add(TOPICS[type(message)], at, message.seq, payload_of(message))
        if isinstance(message, Telemetry):
            self._show(message)

    def _show(self, message: Telemetry) -> None:
        for row in message.rows:
            if row[0] >= self._next:
                at = nanoseconds(row[0])
                self._next = (at + self._step) / NANO - 0.5 / NANO
                self._writer.add("physics", at, 0, row_json(row, message.inverters, self._quantities))
        for event in message.events:
            self._writer.add("events", nanoseconds(event.t), 0, event_json(event))

    def close(self) -> None:
        self._writer.close()
