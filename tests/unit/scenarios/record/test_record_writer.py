"""A writer whose disk stands still, and one that writes for hours."""

from __future__ import annotations

import threading
import tracemalloc
from pathlib import Path
from typing import Any, Literal

import pytest
from msgspec.structs import replace

from gridpeers.scenarios.record import record_writer
from gridpeers.scenarios.record.record_file import RecordFile
from gridpeers.scenarios.record.record_info import RecordInfo
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
    return RecordWriter(folder, replace(info_of(2), driver=driver))


def test_who_records_waits_for_a_disk_that_stands_still(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Once too much waits for the disk, so that the memory of a run is bounded; then nothing is missing."""
    one, stands, goes_on = writer(tmp_path), threading.Event(), threading.Event()
    real = record_writer.Writer.flush

    def flush(of: Any) -> None:
        stands.set()
        assert goes_on.wait(30.0)
        real(of)

    monkeypatch.setattr(record_writer.Writer, "flush", flush)
    monkeypatch.setattr(record_writer, "BEHIND", 10_000)
    taken: list[int] = []

    def record() -> None:
        for number in range(20):
            one.add("telemetry", 10**9, number, bytes(1000))
            taken.append(number)

    one.add("telemetry", 0, 0, b"x")
    assert stands.wait(30.0)
    recorder = threading.Thread(target=record)
    recorder.start()
    recorder.join(0.3)

    assert recorder.is_alive()
    assert len(taken) == 10
    goes_on.set()
    recorder.join(30.0)
    one.close()
    assert len(list(RecordFile(tmp_path / "run.mcap").messages())) == 21


def test_a_long_run_takes_no_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of chunks nothing is kept."""
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
    assert len(RecordFile(tmp_path / "run.mcap").ends) == 500
