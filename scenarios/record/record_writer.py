"""Write the record of one case while it runs: chunks, each on the disk within a second of its first message.

A thread of its own encodes, compresses and writes, so that the run waits for no disk; a run in one process, which does
nothing else, writes in between. A full or broken disk ends the
record with one sentence, and the run goes on. What is in the file can be read whatever ends the process.
"""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryFile
from time import monotonic
from typing import Any, NamedTuple, cast

import lz4.frame  # noqa: F401  # without these two mcap fails at the first chunk
import zstandard  # noqa: F401
from mcap.data_stream import RecordBuilder
from mcap.records import ChunkIndex
from mcap.writer import CompressionType, Writer

from gridpeers.scenarios.record.record_info import METADATA, PROFILE, RecordChannel, RecordInfo, Topic

SYNC = 0.9
"""Time (s) between two calls that have the disk keep all against a loss of power; other files wait meanwhile."""

PERIOD = 0.25
"""Longest time (s) that a message waits for its chunk: with the time that its node has kept it, less than 1 s."""

CHUNK = 150_000
"""Bytes of messages from which on a chunk is written at once: in one process a run pays less for small ones, which the
processor's cache holds, and a reader takes one at a time."""

BEHIND = 64_000_000
"""Bytes of messages that may wait for the disk; more end the record, so that the memory of a run is bounded."""


class _Item(NamedTuple):
    topic: Topic
    t: int
    number: int
    data: bytes


class _WholeWrites:
    """A file to which all that was written since the last flush goes at once; on a failure none of it stays."""

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
        """Write what is kept; if that fails, cut the file where it ended before, and raise OSError."""
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

    Raise OSError if the file cannot be made. Later errors end the record: `failure` has the reason.
    """

    def __init__(self, path: Path, info: RecordInfo, channels: tuple[RecordChannel, ...]) -> None:
        self.path = path
        self.failure = ""
        """Why the record ended early; empty while it goes on, and after a whole one."""
        self.ended = 0
        self._index = _FileIndex(path.parent)  # should the system give no file for it, there is no empty record
        self._file = _WholeWrites(path)
        # LZ4 takes a third of the time and half as much room again: beside a run in one process that time counts.
        compression = CompressionType.LZ4 if info.driver == "inprocess" else CompressionType.ZSTD
        self._writer = Writer(cast("Any", self._file), chunk_size=2 * CHUNK, compression=compression)
        # the one place where a run of days would grow: should the library name it otherwise, a test tells
        self._writer._Writer__chunk_indices = self._index  # type: ignore[attr-defined,unused-ignore]  # noqa: SLF001
        self._channels: dict[Topic, int] = {}
        self._begin(info, channels)
        self._waiting: list[_Item] = []
        self._bytes = 0
        self._wake = threading.Event()
        self._closing = False
        self._lock = threading.Lock()
        self._closed = threading.Event()
        self._written_at = self._began = monotonic()
        self._syncs = False
        self._thread: threading.Thread | None = None
        if info.driver != "inprocess":  # there the run would take turns with it, 5 ms each, and wait for longer
            self._thread = threading.Thread(target=self._write_all, name="record", daemon=True)
            self._thread.start()

    def _begin(self, info: RecordInfo, channels: tuple[RecordChannel, ...]) -> None:
        writer = self._writer
        writer.start(profile=PROFILE, library=f"gridpeers {info.versions.get('gridpeers', '')}".strip())
        writer.add_metadata(METADATA, info.to_metadata())
        for channel in channels:
            schema = writer.register_schema(channel.schema_name, "jsonschema", channel.schema)
            self._channels[channel.topic] = writer.register_channel(channel.topic, channel.encoding, schema)
        self._flush()

    def add(self, topic: Topic, t: int, number: int, data: bytes) -> None:
        """Take a message of run time t (ns); it is on the disk within a second."""
        if self.failure:
            return
        with self._lock:
            self._waiting.append(_Item(topic, t, number, data))
            self._bytes += len(data)
            many = self._bytes
        if many > BEHIND:
            self._fail(f"its disk takes too long: {many / 1e6:.0f} MB wait for it")
        elif self._thread is None:
            if many > CHUNK or monotonic() - self._written_at > PERIOD:
                self._write()
        elif many > CHUNK:
            self._wake.set()

    def close(self) -> None:
        if self._closing:
            return
        self._closing = True
        self._wake.set()
        self._closed.set()
        if self._thread is not None:
            self._thread.join()
        elif not self.failure:
            self._write()
        if not self.failure:
            try:
                self._writer.finish()  # type: ignore[no-untyped-call,unused-ignore]  # as mcap declares it
                self._file.flush()
            except OSError as error:
                self._fail(error.strerror or str(error))
        self._index.close()
        self._file.close()

    # ---------------------------------------------------------------- the thread

    def _write_all(self) -> None:
        """Write a chunk every `PERIOD`, or when there is much to write, until the end."""
        while not self.failure:
            self._wake.wait(PERIOD)
            self._wake.clear()
            closing = self._closing
            self._write()
            if closing:
                return

    def _write(self) -> None:
        """Write what waits as a chunk, and have the disk keep it now and then."""
        try:
            self._write_waiting()
            self._written_at = monotonic()
            if not self._syncs and self._written_at - self._began > SYNC:  # a shorter run has no need of it
                self._syncs, words = True, (self._file.descriptor(),)
                threading.Thread(target=self._sync_all, args=words, name="sync", daemon=True).start()
        except OSError as error:
            self._fail(error.strerror or str(error))

    def _sync_all(self, descriptor: int) -> None:
        """Have the disk keep what is written, also if the machine loses its power, once a `SYNC` until the end.

        A busy disk takes its time for that, and the writer must not wait for it.
        """
        with contextlib.suppress(OSError):  # of a full disk, which the writer tells
            while not self._closed.wait(SYNC):
                os.fsync(descriptor)
        os.close(descriptor)

    def _write_waiting(self) -> None:
        with self._lock:
            items, self._waiting = self._waiting, []
            self._bytes = 0
        for item in items:
            self._writer.add_message(self._channels[item.topic], item.t, item.data, item.t, item.number)
        if items:
            self._flush()
            self.ended = items[-1].t

    def _flush(self) -> None:
        self._writer.flush()  # type: ignore[no-untyped-call,unused-ignore]  # as mcap declares it

    def _fail(self, why: str) -> None:
        self.failure = self.failure or why
        with self._lock:
            self._waiting.clear()
            self._bytes = 0
