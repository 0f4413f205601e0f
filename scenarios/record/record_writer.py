"""Write the record of one case while it runs: chunks, each in the file within a second of its first message.

A thread encodes, compresses and writes, so that the run waits for no disk that keeps up; a run in one process writes in
between. A full or broken disk ends the record: it is read up to its last whole chunk.
"""

from __future__ import annotations

import contextlib
import os
import threading
from collections import deque
from math import inf
from pathlib import Path
from time import monotonic

import lz4.frame  # noqa: F401  # without these two mcap fails at the first chunk
import zstandard  # noqa: F401  # as lz4.frame
from mcap.writer import CompressionType, IndexType, Writer

from gridpeers.scenarios.record.record_info import FILE, METADATA, PROFILE, TOPICS, RecordInfo, Topic
from gridpeers.wire.codec import payload_of
from gridpeers.wire.messages import Journal, LinkReport, LinkRequest, Telemetry

PERIOD = 0.25
"""Longest time (s) that a message waits for its chunk: with the time that its node has kept it, less than 1 s."""

CHUNK = 150_000
"""Bytes of messages from which on a chunk is written at once: in one process a run pays less for small ones, which the
processor's cache holds, and a reader takes one at a time."""


SYNC = 0.9  # Time (s) from which on the thread has the disk keep what is written, against a loss of power


class RecordWriter:
    """Record one case: give it all that the plant publishes for recorders, then close it.

    Raise OSError if the file cannot be made. A later one ends the record, and is its `error`.
    """

    def __init__(self, folder: Path, info: RecordInfo) -> None:
        self.path = folder / FILE
        self.error: OSError | None = None
        """Why the record ended early; None while it goes on, and after a whole one."""
        self._file = self.path.open("xb")
        # LZ4 takes a third of the time and half as much room again: beside a run in one process that time counts.
        compression = CompressionType.LZ4 if info.driver == "inprocess" else CompressionType.ZSTD
        self._writer = Writer(self._file, 2 * CHUNK, compression, IndexType.METADATA)
        # the places of all chunks take 5 MB an hour; our reader needs none, and mcap has no public way to drop them
        self._writer._Writer__chunk_indices = deque(maxlen=0)  # type: ignore[attr-defined,unused-ignore]  # noqa: SLF001
        self._writer.start(profile=PROFILE, library=f"gridpeers {info.versions.get('gridpeers', '')}".strip())
        self._writer.add_metadata(METADATA, info.to_metadata())
        self._channels = {topic: self._writer.register_channel(topic, "msgpack", 0) for topic in TOPICS.values()}
        self._flush()
        self._t = 0.0
        """Run time of the last telemetry (s)."""
        self._waiting: list[tuple[Topic, int, int, bytes]] = []
        self._bytes = 0
        self._written_at, self._synced_at = -inf, monotonic()
        self._lock, self._wake, self._closing = threading.Lock(), threading.Event(), False
        self._thread: threading.Thread | None = None
        if info.driver != "inprocess":  # there the run would take turns with it, 5 ms each, and wait for longer
            self._thread = threading.Thread(target=self._write_all, name="record", daemon=True)
            self._thread.start()

    def __call__(self, message: Telemetry | Journal | LinkReport | LinkRequest) -> None:
        """Record a message of the plant for recorders; reports on links have no time of their own."""
        if isinstance(message, Telemetry):
            self._t = message.t
        t = self._t if isinstance(message, LinkReport) else message.t
        self.add(TOPICS[type(message)], round(t * 1e9), message.seq, payload_of(message))

    def add(self, topic: Topic, t: int, number: int, data: bytes) -> None:
        """Take a payload of run time t (ns); it is in the file within a second."""
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

    def close(self) -> None:
        if self._closing:
            return
        self._closing = True
        self._wake.set()
        if self._thread is not None:
            self._thread.join()
        elif self.error is None:
            self._write(last=True)
        with contextlib.suppress(OSError):  # of a full disk, which `error` has
            self._file.close()

    def _write_all(self) -> None:
        closing = False
        while self.error is None and not closing:
            self._wake.wait(PERIOD)
            self._wake.clear()
            closing = self._closing
            self._write(last=closing)

    def _write(self, *, last: bool = False) -> None:
        with self._lock:
            waiting, self._waiting, self._bytes = self._waiting, [], 0
        try:
            for topic, t, number, data in waiting:
                self._writer.add_message(self._channels[topic], t, data, t, number)
            if last:
                self._writer.finish()  # type: ignore[no-untyped-call,unused-ignore]  # as mcap declares it
            if waiting or last:
                self._flush()
            self._written_at = monotonic()
            if self._thread is not None and self._written_at - self._synced_at > SYNC:
                os.fsync(self._file.fileno())
                self._synced_at = monotonic()
        except OSError as error:
            self.error = OSError(error.errno, error.strerror or str(error), str(self.path))

    def _flush(self) -> None:
        self._writer.flush()  # type: ignore[no-untyped-call,unused-ignore]  # as mcap declares it
        self._file.flush()
