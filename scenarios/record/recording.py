"""The record of one case under way: which message of the run goes to which channel, and what viewers of MCAP get."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from pathlib import Path

import msgspec

from gridpeers.scenarios.record.record_info import FILE, TOPICS, RecordInfo, channels
from gridpeers.scenarios.record.record_writer import RecordWriter
from gridpeers.wire.codec import payload_of
from gridpeers.wire.messages import Journal, LinkReport, LinkRequest, PlantEvent, Telemetry

_encode = msgspec.json.encode

NANO = 1_000_000_000


def nanoseconds(t: float) -> int:
    """Return a run time (s) as time in a record: whole nanoseconds since t = 0.

    Examples
    --------
    >>> nanoseconds(4.3)
    4300000000
    """
    return round(t * NANO)


class PhysicsTemplate:
    r"""Rows of telemetry as JSON objects.

    Examples
    --------
    >>> PhysicsTemplate(["inv1"], ["f_Hz", "P_W"]).of(b"0.02,60.0,nan\n", (0.02, 60.0, float("nan")))
    b'{"t_s":0.02,"inv1":{"f_Hz":60.0,"P_W":null}}'
    """

    def __init__(self, inverters: Sequence[str], quantities: Sequence[str]) -> None:
        values = ",".join(f'"{quantity}":%b' for quantity in quantities)
        objects = "".join(f',"{name}":{{{values}}}' for name in inverters)
        self._template = f'{{"t_s":%b{objects}}}'.encode()

    def of(self, line: bytes, row: Sequence[float]) -> bytes:
        """Return a row from its line of history.csv, whose texts of finite numbers are those of JSON."""
        texts = line[:-1].split(b",")
        if b"n" in line:
            texts = [text if isfinite(number) else b"null" for text, number in zip(texts, row, strict=True)]
        return self._template % tuple(texts)


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
    return _encode(log)


VIEW_STEP, LIVE_VIEW_STEP = 0.2, 0.05
"""Least distance (s) of the rows that viewers get in simulated time, where each takes as long as a decision, and in
wall-clock time, where they take a quarter of the file at 0.01 s. All rows are in the telemetry."""

BESIDE, AHEAD = 2_000_000, 60.0
"""Room (bytes) that a full disk keeps for events, log, report and figures; and time (s) for whose rows it keeps some,
of a run without an end."""


class Recording:
    """Record one case: give it all that the plant publishes for recorders, then close it.

    Raise OSError if the file cannot be made.
    """

    def __init__(self, folder: Path, info: RecordInfo, quantities: Sequence[str]) -> None:
        self._writer = RecordWriter(folder / FILE, info, channels(info.inverters, tuple(quantities)))
        self._quantities = quantities
        self._template: PhysicsTemplate | None = None
        self._step = nanoseconds(LIVE_VIEW_STEP if info.clock == "wall" else VIEW_STEP)
        self._t = 0.0
        """Time (s) of the last telemetry."""
        self._next = 0.0
        """Time (s) from which on a row is the next for viewers."""
        self._end = info.plant.end
        self._history = 0
        """Bytes of history.csv so far."""

    @property
    def failure(self) -> str:
        writer = self._writer
        if not writer.failure:
            return ""
        return f"the record {writer.path.name} ends at {writer.ended / 1e9:.2f} s: {writer.failure}"

    def telemetry(self, message: Telemetry, lines: Sequence[bytes]) -> None:
        """Record rows and events; `lines` are the rows' lines in history.csv."""
        writer, self._t = self._writer, message.t
        self._history += sum(map(len, lines))
        if message.t > 0.0:
            ahead = AHEAD if self._end is None else self._end - message.t
            writer.spare = BESIDE + self._history * ahead / message.t
        if self._template is None:
            self._template = PhysicsTemplate(message.inverters, self._quantities)
        writer.add("telemetry", nanoseconds(message.t), message.seq, payload_of(message))
        for row, line in zip(message.rows, lines, strict=True):
            if row[0] < self._next:
                continue
            at = nanoseconds(row[0])
            self._next = (at + self._step) / NANO - 0.5 / NANO
            writer.add("physics", at, 0, self._template.of(line, row))
        for event in message.events:
            writer.add("events", nanoseconds(event.t), 0, event_json(event))

    def message(self, message: Journal | LinkReport | LinkRequest) -> None:
        at = nanoseconds(self._t if isinstance(message, LinkReport) else message.t)
        self._writer.add(TOPICS[type(message)], at, message.seq, payload_of(message))

    def close(self) -> None:
        self._writer.close()
