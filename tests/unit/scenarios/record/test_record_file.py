"""A record that is cut off, damaged, from a later version, or none of ours: one line says so, and the rest is read."""

from __future__ import annotations

import random
from io import BytesIO
from itertools import islice
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import msgpack
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from gridpeers.scenarios.record.message_index import MessageIndex
from gridpeers.scenarios.record.record_file import RecordFile, RecordFileError
from gridpeers.scenarios.record.record_info import FILE, FORMAT, METADATA, PROFILE
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.wire.messages import Message
from tests.record.recorded_runs import recorded_in_chunks, recorded_run

CALM = '[time]\nend_s = 2.0\n[case.calm]\nsecondary = "all"\ngraph = "ring"\n'


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A record of 2 s, in several chunks."""
    return recorded_in_chunks(CALM, tmp_path_factory.mktemp("record"), "calm").path


def read_all(path: Path) -> tuple[RunRecord, int]:
    """Read everything there is in a record; return it with the number of its messages."""
    record = RunRecord.open(path)
    count = sum(1 for _ in record.messages(Message))
    for agent in record.agents:
        count += sum(1 for _ in record.decisions(agent))
    record.events()
    assert all(len(text) < 300 and "\n" not in text for text in record.damage)
    return record, count


def test_a_whole_record_says_so(whole: Path) -> None:
    """All of it is there, and nothing is damaged."""
    record, count = read_all(whole)

    assert record.complete
    assert record.damage == ()
    assert record.outcome == ""
    assert record.t_end == 2.0
    assert count == 9 * 100 * 3


def test_any_reader_of_mcap_files_finds_the_messages(whole: Path) -> None:
    """All of them, in the order of time: msgpack maps, each with its type and the number that the file has for it."""
    with whole.open("rb") as file:
        found = [(channel, message) for _, channel, message in make_reader(file, validate_crcs=True).iter_messages()]

    times = [message.log_time for _, message in found]
    assert times == sorted(times)
    assert (times[0], times[-1]) == (0, 2 * 10**9)
    assert {channel.message_encoding for channel, _ in found} == {"msgpack"}
    for channel, message in found:
        content = msgpack.unpackb(message.data[:-4])
        assert content["type"].lower() == channel.topic
        assert content["seq"] == message.sequence


def test_a_record_cut_off_anywhere_is_read_up_to_there(whole: Path, tmp_path: Path) -> None:
    """At every length, once the file says what it is, it opens, tells that it is cut off, and has what came before."""
    data, counts = whole.read_bytes(), []
    opened = 0
    for length in (*range(1, 4000, 197), *range(4000, len(data), len(data) // 25)):
        (tmp_path / FILE).write_bytes(data[:length])
        try:
            record, count = read_all(tmp_path)
        except RecordFileError:
            assert opened == 0
            continue
        opened += 1
        counts.append(count)
        assert not record.complete
        assert any("cut off" in text for text in record.damage)

    assert opened > 15
    assert counts == sorted(counts)
    assert counts[-1] > counts[len(counts) // 2] > 0


def test_a_record_is_read_up_to_its_first_damaged_chunk(whole: Path, tmp_path: Path) -> None:
    """One bit of a chunk is flipped: what is before it is there as it was, the rest is not, and that is told once."""
    data = bytearray(whole.read_bytes())
    data[len(data) // 2] ^= 1
    (tmp_path / FILE).write_bytes(data)
    intact = RunRecord.open(whole)

    record, count = read_all(tmp_path)
    record.refresh()
    end = record.t_end

    assert count > 100
    assert 0.0 < end < 2.0
    (told,) = record.damage
    assert f"the file is damaged after t = {end:.2f} s, and read up to there" in told
    assert not record.complete
    assert record.outcome is None
    for agent in record.agents:
        found = list(record.decisions(agent))
        assert len(found) > 5
        assert found == list(islice(intact.decisions(agent), len(found)))
    assert record.decision("inv1", 0.2) == intact.decision("inv1", 0.2)
    with pytest.raises(RecordFileError, match=r"t = 1\.9 s is outside of the record, .*: the file is damaged"):
        RunRecord.open(tmp_path).decision("inv1", 1.9)


def test_a_record_with_changed_bytes_is_read_up_to_them(whole: Path, tmp_path: Path) -> None:
    """Whatever byte is wrong, what is before it is read, the rest is told once, and nothing else is raised."""
    data, draws, told = whole.read_bytes(), random.Random(7), 0
    for _ in range(40):
        changed = bytearray(data)
        for _ in range(draws.choice((1, 1, 20))):
            changed[draws.randrange(len(data))] = draws.randrange(256)
        (tmp_path / FILE).write_bytes(changed)
        try:
            record, _ = read_all(tmp_path)
            told += bool(record.damage)
            assert len(record.damage) <= 1
        except RecordFileError:
            told += 1

    assert told > 20


def mcap(profile: str, **metadata: str) -> bytes:
    writer = Writer(file := BytesIO())
    writer.start(profile=profile)
    writer.add_metadata(METADATA, metadata)
    writer.finish()
    return file.getvalue()


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"", "this is not a record: it does not begin as an MCAP file"),
        (b"t_s,inv1_f_Hz\n", "this is not a record"),
        (b"\x89MCAP0\r\n", "the file ends before its description of the run: 8 bytes"),
        (mcap("ros2"), "not a record of gridpeers: its profile is 'ros2'"),
        (
            mcap(PROFILE, format=str(FORMAT + 1), gridpeers="9.9", info="?"),
            f"of format {FORMAT + 1}, written by gridpeers 9.9; .*install the later",
        ),
    ],
    ids=["empty", "a table", "the beginning of a record", "of others", "a later format"],
)
def test_another_file_is_told_in_one_line(content: bytes, complaint: str, tmp_path: Path) -> None:
    """Before anything else is read."""
    (tmp_path / FILE).write_bytes(content)

    with pytest.raises(RecordFileError, match=complaint):
        RunRecord.open(tmp_path)


def test_what_was_not_there_is_told(whole: Path, tmp_path: Path) -> None:
    """An agent, a folder without a record, a file; of a time outside `why` says it (test_why.py)."""
    with pytest.raises(RecordFileError, match="there was no agent inv77; agents are inv1-9"):
        RunRecord.open(whole).decision("inv77", 0.5)
    with pytest.raises(RecordFileError, match=r"there is no run\.mcap"):
        RunRecord.open(tmp_path)
    with pytest.raises(RecordFileError, match="cannot be read: No such file"):
        RunRecord.open(whole.parent / "other.mcap")


def test_physics_alone_have_no_decisions(tmp_path: Path) -> None:
    """A record of the physics has rows and events, and says why it has no decisions."""
    (tmp_path / "calm.toml").write_text(CALM, encoding="utf-8")
    record = recorded_run(tmp_path / "calm.toml", "calm", tmp_path / "calm", level="physics")

    assert record.physics().t[-1] == 2.0
    assert list(record.messages(Message)) == []
    with pytest.raises(RecordFileError, match='record = "physics"'):
        record.decision("inv1", 0.5)


def index_of(clock: str, speed: float, T_c: float = 0.02) -> MessageIndex:
    """Of a file with a part for each second of a minute."""
    info: Any = SimpleNamespace(clock=clock, T_c=T_c, plant=SimpleNamespace(speed=speed))
    ends = [float(t + 1) for t in range(60)]
    return MessageIndex(cast(RecordFile, SimpleNamespace(info=info, ends=ends)))


@pytest.mark.parametrize(
    ("clock", "speed", "last"), [("simulated", 40.0, 12), ("realtime", 1.0, 12), ("realtime", 10.0, 30)]
)
def test_what_comes_late_by_the_clock_is_looked_for_at_the_speed_of_the_run(
    clock: str, speed: float, last: int
) -> None:
    """A journal comes up to two seconds late by the clock, which are twenty of run time at ten times real time."""
    assert index_of(clock, speed).near(10.0, 10.0) == range(9, last)
