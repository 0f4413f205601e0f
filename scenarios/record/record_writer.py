"""Write the record of one case while it runs: chunks, each on the disk within a second of its first message.

A thread encodes, compresses and writes, so that the run waits for no disk that keeps up; a run in one process writes in
between. A full or broken disk ends the record with its last whole chunk.
"""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Iterator, Sequence
from math import inf
from pathlib import Path
from tempfile import TemporaryFile
from time import monotonic, sleep
from typing import Any, cast

import lz4.frame  # noqa: F401  # without these two mcap fails at the first chunk
import msgspec
import zstandard  # noqa: F401  # as lz4.frame
from mcap.data_stream import RecordBuilder
from mcap.records import ChunkIndex
from mcap.writer import CompressionType, Writer

from gridpeers.scenarios.record.record_info import (
    FILE,
    METADATA,
    PROFILE,
    TOPICS,
    RecordChannel,
    RecordInfo,
    Topic,
    channels,
)
from gridpeers.scenarios.results.case_tables import QUANTITIES
from gridpeers.wire.codec import payload_of
from gridpeers.wire.messages import Journal, LinkReport, LinkRequest, PlantEvent, Telemetry

SYNC = 0.9
"""Time (s) between two calls that have the disk keep all against a loss of power; other files wait meanwhile."""

PERIOD = 0.25
"""Longest time (s) that a message waits for its chunk: with the time that its node has kept it, less than 1 s."""

CHUNK = 150_000
"""Bytes of messages from which on a chunk is written at once: in one process a run pays less for small ones, which the
processor's cache holds, and a reader takes one at a time."""

BEHIND = 64_000_000
"""Bytes of messages that may wait for the disk: with more, who records waits too, so that memory is bounded."""


class _WholeWrites:
    """A file that takes all that was written since the last flush at once, or none of it."""

    def __init__(self, path: Path) -> None:
        self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
        self._pending: list[bytes] = []
        self._position = self._written = 0

    def write(self, data: bytes) -> int:
        self._pending.append(data)
        self._position += len(data)
        return len(data)

    def tell(self) -> int:
        return self._position

    def flush(self) -> None:
        left = memoryview(b"".join(self._pending))
        self._pending.clear()
        try:
            while left:
                left = left[os.write(self._file, left) :]
        except OSError:
            with contextlib.suppress(OSError):
                os.ftruncate(self._file, self._written)
            raise
        self._written = self._position

    def descriptor(self) -> int:
        """Return another descriptor of the file, for its taker to close."""
        return os.dup(self._file)

    def close(self) -> None:
        os.close(self._file)


class _FileIndex:
    """The index of all chunks, in a file without a name: of an hour it is 10 MB, in memory as objects 17 MB."""

    def __init__(self, folder: Path) -> None:
        self._file = TemporaryFile(dir=folder)  # noqa: SIM115  # it is open as long as the record

    def append(self, index: ChunkIndex) -> None:
        builder = RecordBuilder()
        index.write(builder)
        self._file.write(builder.end())  # type: ignore[no-untyped-call,unused-ignore]  # as mcap declares it

    def __iter__(self) -> Iterator[_FileIndex]:
        yield self

    def write(self, builder: RecordBuilder) -> None:
        self._file.seek(0)
        builder.write(self._file.read())

    def close(self) -> None:
        with contextlib.suppress(OSError):  # of a full disk: what it could not take is not wanted any more
            self._file.close()


class RecordWriter:
    """Write one record: `add` its messages, then `close` it.

    Raise OSError if the file cannot be made. A later one ends the record, and is its `error`.
    """

    def __init__(self, path: Path, info: RecordInfo, channels: tuple[RecordChannel, ...]) -> None:
        self.path = path
        self.error: OSError | None = None
        """Why the record ended early; None while it goes on, and after a whole one."""
        self._index = _FileIndex(path.parent)  # should the system give no file for it, there is no empty record
        self._file = _WholeWrites(path)
        # LZ4 takes a third of the time and half as much room again: beside a run in one process that time counts.
        compression = CompressionType.LZ4 if info.driver == "inprocess" else CompressionType.ZSTD
        self._writer = Writer(cast("Any", self._file), chunk_size=2 * CHUNK, compression=compression)
        # mcap has no public way to keep the index out of memory, where that of a run of days grows; a test fails if the
        # library renames it
        self._writer._Writer__chunk_indices = self._index  # type: ignore[attr-defined,unused-ignore]  # noqa: SLF001
        self._writer.start(profile=PROFILE, library=f"gridpeers {info.versions.get('gridpeers', '')}".strip())
        self._writer.add_metadata(METADATA, info.to_metadata())
        self._channels: dict[Topic, int] = {}
        for channel in channels:
            schema = self._writer.register_schema(channel.schema_name, "jsonschema", channel.schema)
            self._channels[channel.topic] = self._writer.register_channel(channel.topic, channel.encoding, schema)
        self._flush()
        self._waiting: list[tuple[Topic, int, int, bytes]] = []
        self._bytes = 0
        self._lock, self._wake, self._closed = threading.Lock(), threading.Event(), threading.Event()
        self._began, self._written_at = monotonic(), -inf
        self._syncs = False
        self._thread: threading.Thread | None = None
        if info.driver != "inprocess":  # there the run would take turns with it, 5 ms each, and wait for longer
            self._thread = threading.Thread(target=self._write_all, name="record", daemon=True)
            self._thread.start()

    def add(self, topic: Topic, t: int, number: int, data: bytes) -> None:
        """Take a message of run time t (ns); it is on the disk within a second."""
        if self.error is not None:
            return
        with self._lock:
            self._waiting.append((topic, t, number, data))
            self._bytes += len(data)
            many = self._bytes
        if many > CHUNK or monotonic() - self._written_at > PERIOD:
            if self._thread is None:
                self._write()
            else:
                self._wake.set()
        while self._thread is not None and self._bytes > BEHIND and self.error is None:
            sleep(0.01)

    def close(self) -> None:
        if self._closed.is_set():
            return
        self._closed.set()
        self._wake.set()
        if self._thread is not None:
            self._thread.join()
        elif self.error is None:
            self._write()
        if self.error is None:
            try:
                self._writer.finish()  # type: ignore[no-untyped-call,unused-ignore]  # as mcap declares it
                self._file.flush()
            except OSError as error:
                self._fail(error)
        self._index.close()
        self._file.close()

    def _write_all(self) -> None:
        while self.error is None:
            self._wake.wait(PERIOD)
            self._wake.clear()
            closing = self._closed.is_set()
            self._write()
            if closing:
                return

    def _write(self) -> None:
        try:
            with self._lock:
                waiting, self._waiting, self._bytes = self._waiting, [], 0
            for topic, t, number, data in waiting:
                self._writer.add_message(self._channels[topic], t, data, t, number)
            if waiting:
                self._flush()
            self._written_at = monotonic()
            if not self._syncs and self._written_at - self._began > SYNC:  # a shorter run has no need of it
                self._syncs = True
                descriptor = self._file.descriptor()
                threading.Thread(target=self._sync_all, args=(descriptor,), name="sync", daemon=True).start()
        except OSError as error:
            self._fail(error)

    def _sync_all(self, descriptor: int) -> None:
        """Have the disk keep what is written against a loss of power; the writer does not wait for a busy disk."""
        with contextlib.suppress(OSError):  # of a full disk, which the writer reports
            while not self._closed.wait(SYNC):
                os.fsync(descriptor)
        os.close(descriptor)

    def _flush(self) -> None:
        self._writer.flush()  # type: ignore[no-untyped-call,unused-ignore]  # as mcap declares it

    def _fail(self, error: OSError) -> None:
        self.error = OSError(error.errno, error.strerror or str(error), str(self.path))
        with self._lock:
            self._waiting.clear()
            self._bytes = 0


NANO = 1_000_000_000

VIEW_STEP, LIVE_VIEW_STEP = 0.2, 0.05
"""Least distance (s) of the rows that viewers get in simulated time, where each takes as long as a decision, and in
real time, where they take a quarter of the file at 0.01 s. All rows are in the telemetry."""


def nanoseconds(t: float) -> int:
    return round(t * NANO)


class Recording(RecordWriter):
    """Record one case: give it all that the plant publishes for recorders, then close it."""

    def __init__(self, folder: Path, info: RecordInfo) -> None:
        super().__init__(folder / FILE, info, channels(info.inverters, QUANTITIES))
        self._step = nanoseconds(LIVE_VIEW_STEP if info.clock == "wall" else VIEW_STEP)
        self._t = self._next = 0.0
        """Time (s) of the last telemetry, and from which on a row is the next for viewers."""

    def __call__(self, message: Telemetry | Journal | LinkReport | LinkRequest) -> None:
        """Record a message of the plant for recorders; reports on links have no time of their own."""
        if isinstance(message, Telemetry):
            self._t = message.t
        at = nanoseconds(self._t if isinstance(message, LinkReport) else message.t)
        self.add(TOPICS[type(message)], at, message.seq, payload_of(message))
        if isinstance(message, Telemetry):
            for row in message.rows:
                if row[0] >= self._next:
                    self._add_row(message.inverters, row)
            for event in message.events:
                self._add_event(event)

    def _add_row(self, inverters: Sequence[str], row: Sequence[float]) -> None:
        """Add a row for viewers; null stands for a number that is not finite."""
        at, number = nanoseconds(row[0]), len(QUANTITIES)
        self._next = (at + self._step) / NANO - 0.5 / NANO
        starts = range(1, len(row), number)
        parts = (dict(zip(QUANTITIES, row[i : i + number], strict=True)) for i in starts)
        named = dict(zip(inverters, parts, strict=True))
        self.add("physics", at, 0, msgspec.json.encode({"t_s": row[0]} | named))

    def _add_event(self, event: PlantEvent) -> None:
        """Add an event as a `foxglove.Log`, which viewers list."""
        at = nanoseconds(event.t)
        log = {
            "timestamp": {"sec": at // NANO, "nsec": at % NANO},
            "level": 3 if event.kind == "warning" else 2,
            "message": event.text,
            "name": event.kind,
            "file": event.subject,
            "line": 0,
        }
        self.add("events", at, 0, msgspec.json.encode(log))
