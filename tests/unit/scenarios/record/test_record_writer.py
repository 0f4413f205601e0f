"""A writer whose disk fails or stands still: the record ends with its last whole chunk, or who records waits."""

from __future__ import annotations

import errno
import os
import threading
import tracemalloc
from pathlib import Path
from typing import Any, Literal

import msgspec
import pytest
from mcap.reader import make_reader

from gridpeers.scenarios.record import record_writer
from gridpeers.scenarios.record.record_file import RecordFile
from gridpeers.scenarios.record.record_info import RecordInfo, channels
from gridpeers.scenarios.record.record_writer import RecordWriter
from tests.toy.toy_configs import toy_configs


def info_of(n: int) -> RecordInfo:
    """Return what a record says about a run of the toy plant."""
    plant, agents = toy_configs(n)
    return RecordInfo(
        level="all", scenario="toy", case="I", toml="", seed=1, driver="processes", versions={}, inverters=plant.agents,
        plant=plant, agents=agents,
    )  # fmt: skip


def writer(folder: Path, driver: Literal["inprocess", "processes"] = "processes") -> RecordWriter:
    """Return the writer of a record in a folder; of a run in one process it writes by itself, without a thread."""
    info = msgspec.structs.replace(info_of(2), driver=driver)
    return RecordWriter(folder / "run.mcap", info, channels(info.inverters, ("f_Hz",)))


def until(happens: threading.Event) -> None:
    """Wait for something that another thread does."""
    assert happens.wait(30.0)


def test_on_a_full_disk_the_file_ends_with_a_whole_chunk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A write that stops half-way is taken back; the reason is told, and later messages are let go."""
    one = writer(tmp_path)
    one.add("telemetry", 10**9, 0, b"first")
    written, real = threading.Event(), os.write
    wrote: list[int] = []

    def write(descriptor: int, data: Any) -> int:
        if written.is_set():
            if wrote[-1] < 0:
                raise OSError(errno.ENOSPC, "No space left on device")
            wrote.append(-1)
            return real(descriptor, bytes(data)[:20])
        count = real(descriptor, data)
        wrote.append(count)
        written.set()
        return count

    monkeypatch.setattr(record_writer.os, "write", write)
    until(written)
    one.add("telemetry", 2 * 10**9, 1, b"second" * 1000)
    one.close()
    one.add("telemetry", 3 * 10**9, 2, b"third")

    assert one.error is not None
    assert (one.error.strerror, one.error.filename) == ("No space left on device", str(tmp_path / "run.mcap"))
    file = RecordFile(tmp_path / "run.mcap")
    assert [(each.t, each.data) for each in file.messages()] == [(10**9, b"first")]
    assert "cut off between two chunks" in file.damage[0]


def test_who_records_waits_for_a_disk_that_stands_still(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Once too much waits for the disk, so that the memory of a run is bounded; then nothing is missing."""
    one, stands, goes_on, real = writer(tmp_path), threading.Event(), threading.Event(), os.write

    def write(descriptor: int, data: Any) -> int:
        stands.set()
        until(goes_on)
        return real(descriptor, data)

    monkeypatch.setattr(record_writer.os, "write", write)
    monkeypatch.setattr(record_writer, "BEHIND", 10_000)
    taken: list[int] = []

    def record() -> None:
        for number in range(20):
            one.add("telemetry", 10**9, number, bytes(1000))
            taken.append(number)

    one.add("telemetry", 0, 0, b"x")
    until(stands)
    recorder = threading.Thread(target=record)
    recorder.start()
    recorder.join(0.3)

    assert recorder.is_alive()
    assert len(taken) == 10
    goes_on.set()
    recorder.join(30.0)
    one.close()
    assert len(list(RecordFile(tmp_path / "run.mcap").messages())) == 21


def test_the_index_of_a_long_run_takes_no_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of chunks nothing is kept; in the file every chunk is in the index, for viewers, and no other file is left."""
    monkeypatch.setattr(record_writer, "CHUNK", 100)
    one = writer(tmp_path, "inprocess")

    def write(numbers: range) -> int:
        for number in numbers:
            one.add("telemetry", number, number, bytes(200))
        return tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    try:
        grown = -write(range(100)) + write(range(100, 500))
    finally:
        tracemalloc.stop()
    one.close()
    assert grown < 400 * 10
    assert [file.name for file in tmp_path.iterdir()] == ["run.mcap"]

    with (tmp_path / "run.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
        assert summary is not None
        assert len(summary.chunk_indexes) == 500
        assert len(list(make_reader(file).iter_messages())) == 500
