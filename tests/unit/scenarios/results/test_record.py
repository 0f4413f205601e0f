"""What a case leaves on disk: bytes that are equal when the run is, one record, and whole tables of it or none."""

import errno
import hashlib
import struct
import tracemalloc
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from gridpeers.scenarios.record import record_writer
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.scenarios.results.record import Recorder, RecordError
from gridpeers.wire.messages import PlantEvent, Telemetry
from tests.hostile.cases import sound_message
from tests.record.recorded_runs import toy_info
from tests.toy.toy_configs import toy_configs

Rows = tuple[tuple[float, ...], ...]


def telemetry(rows: Rows, events: tuple[PlantEvent, ...] = ()) -> Telemetry:
    message = sound_message(Telemetry, sender="plant", t=rows[-1][0], inverters=("inv1",), rows=rows)
    return replace(message, events=events)


def row(t: float, x: float = 0.1) -> tuple[float, ...]:
    return (t, 60.0, 388200.0, x, 2401.7771198288433, 388200.0, 2401.7771198288433)


ONE = toy_info(*toy_configs(1), level="physics")


def test_the_hash_is_that_of_the_numbers_however_they_came(tmp_path: Path) -> None:
    """How rows are spread over messages leaves no trace in the fingerprint, nor where they are kept."""
    with Recorder(tmp_path / "a") as one:
        one(telemetry((row(0.0), row(0.5), row(1.0))))
        at_once = one.finish(1.0, 0.5)
    with Recorder(tmp_path / "b", record=ONE) as other:
        for t in (0.0, 0.5, 1.0):
            other(telemetry((row(t),)))
        in_pieces = other.finish(1.0, 0.5)

    assert at_once.sha256 == in_pieces.sha256
    numbers = [number for t in (0.0, 0.5, 1.0) for number in row(t)]
    assert at_once.sha256 == hashlib.sha256(struct.pack("<21d", *numbers)).hexdigest() == in_pieces.history.sha256
    assert (tmp_path / "a" / "history.csv").read_bytes() == (tmp_path / "b" / "history.csv").read_bytes()


@settings(deadline=None)  # each example writes a file
@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=6, max_size=6))
def test_every_number_reads_back_to_the_same_bits(
    tmp_path_factory: pytest.TempPathFactory, numbers: list[float]
) -> None:
    """The shortest text that reads back to a float is what is written."""
    folder = tmp_path_factory.mktemp("record") / "case"
    with Recorder(folder, record=ONE) as recorder:
        recorder(telemetry(((0.0, *numbers),)))
        recorded = recorder.finish(0.0, 1.0)

    text = (folder / "history.csv").read_text(encoding="ascii")
    written = [float(number) for number in text.splitlines()[1].split(",")]
    of_record = recorded.history.table[0].tolist()
    assert list(map(repr, written)) == list(map(repr, of_record)) == list(map(repr, [0.0, *numbers]))


def test_a_case_that_was_not_finished_has_its_record_alone(tmp_path: Path) -> None:
    """What came of a broken case can be read, and cannot be taken for the whole."""
    event = PlantEvent(t=0.0, kind="roster", subject="inv3", text="inv3 died, says the plant")
    with Recorder(tmp_path / "I", record=ONE) as recorder:
        recorder(telemetry((row(0.0),), (event,)))

    assert [path.name for path in (tmp_path / "I").iterdir()] == ["run.mcap"]
    record = RunRecord.open(tmp_path / "I")
    assert (record.events(), record.physics().table.tolist()) == ((event,), [list(row(0.0))])


def test_a_disk_that_takes_no_more_is_an_error_at_once_and_again_at_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """There is no other account, so no case ends well without its record."""
    with Recorder(tmp_path / "I", record=ONE) as recorder:
        recorder(telemetry((row(0.0),)))
        monkeypatch.setattr(record_writer, "PERIOD", -1.0)
        monkeypatch.setattr(record_writer.Writer, "flush", no_room)
        for act in (lambda: recorder(telemetry((row(0.5),))), lambda: recorder.finish(0.5, 0.5)):
            with pytest.raises(OSError, match="No space left") as caught:
                act()
            assert caught.value.filename == str(tmp_path / "I" / "run.mcap")

    assert RunRecord.open(tmp_path / "I").t_end == 0.0


def no_room(*_: object) -> int:
    raise OSError(errno.ENOSPC, "No space left on device")


def test_a_history_with_a_gap_is_no_history_unless_the_recorder_may_be_out_of_reach(tmp_path: Path) -> None:
    """Lost telemetry is an error that says how much came; in real time the times of what is missing are known."""
    rows = tuple(row(0.5 * k) for k in (0, 1, 2, 7, 8))
    with Recorder(tmp_path / "I") as strict, Recorder(tmp_path / "II", gaps=True) as lenient:
        for recorder in (strict, lenient):
            recorder(telemetry(rows))
        recorded = lenient.finish()
        with pytest.raises(RecordError, match=r"5 rows, but 4 s in steps of 0.5 s are 9; the last one is of 4 s"):
            strict.finish(4.0, 0.5)

    assert recorded.missing == [(1.0, 3.5)]
    assert (recorded.ended, recorded.history.t.tolist()) == (4.0, [0.0, 0.5, 1.0, 3.5, 4.0])


def test_a_recorder_keeps_no_rows_and_has_them_once_at_its_end(tmp_path: Path) -> None:
    """A run of hours takes no more memory than a short one; its rows are read from the file, into one table."""
    inverters, values = tuple(f"inv{i}" for i in range(10)), tuple(float(k) for k in range(60))
    with Recorder(tmp_path / "I", record=toy_info(*toy_configs(10))) as recorder:

        def record(numbers: range) -> None:
            for first in numbers[::100]:
                rows = tuple((0.01 * k, *values) for k in range(first, first + 100))
                recorder(sound_message(Telemetry, t=rows[-1][0], inverters=inverters, rows=rows))

        record(range(1_000))
        tracemalloc.start()
        record(range(1_000, 4_000))
        grown, _ = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        record(range(4_000, 16_000))
        tracemalloc.start()
        history = recorder.finish(0.01 * 15_999, 0.01).history
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()

    assert (len(history.t), history.V_set[-1, -1]) == (16_000, 59.0)
    assert grown < 300_000  # a chunk that waits
    assert peak < 8 * 16_000 * 61 + 10_000_000  # the table, and some chunks with their messages
