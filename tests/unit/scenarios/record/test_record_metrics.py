"""A record is measured as its run was; one that is cut off, up to its end."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

import gridpeers as gp
from gridpeers.runs.result import Result
from gridpeers.scenarios.record.record_file import RecordFileError
from gridpeers.scenarios.record.record_metrics import report_of
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.scenarios.results.record import Recorder
from tests.command_line import invoke
from tests.unit.scenarios.record.test_record_writer import info_of

MEASURES = ("f_error_Hz", "MPSI", "V_error", "MQSI", "t_restore_s")


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Result:
    """The paper's case IV."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("gridpeers.scenarios.record.record_writer.CHUNK", 50_000)
        return gp.load("islanding").run("IV", folder=tmp_path_factory.mktemp("run") / "here")


def test_the_measures_are_those_of_the_run(result: Result) -> None:
    """Each window has the numbers of metrics.json, made from run.mcap alone."""
    report = report_of(result.run_record)

    found = report.findings.results["IV"]
    assert list(found) == ["event1", "event2"]
    for label, steady in found.items():
        for name in MEASURES:
            assert getattr(steady, name) == result.numbers["cases"]["IV"][label][name]
    assert report.notes == []


def test_a_record_that_is_cut_off_is_measured_up_to_its_end(result: Result, tmp_path: Path) -> None:
    """What it reaches has its numbers, a window that it does not reach is named, and the cut is told."""
    data = result.run_record.path.read_bytes()
    (tmp_path / "run.mcap").write_bytes(data[: len(data) // 2])
    record = RunRecord.open(tmp_path)
    code, printed = invoke("metrics", str(tmp_path))

    report = report_of(record)

    assert 1.5 < record.t_end < 4.0
    assert list(report.findings.results["IV"]) == ["event1"]
    assert report.findings.results["IV"]["event1"].f_error_Hz == pytest.approx(0.0, abs=0.01)
    notes = "\n".join(report.notes)
    assert f"the record ends at {record.physics().t[-1]:.2f} s of 7 s" in notes
    assert "not measured: event2" in notes
    assert "cut off" in notes
    assert code == 0
    assert "Frequency and power sharing after each event" in printed
    assert all(note in printed for note in report.notes)


def test_a_record_without_a_scenario_is_told(tmp_path: Path) -> None:
    """A live run without a scenario has no events to be measured after."""
    with Recorder(tmp_path / "case", record=msgspec.structs.replace(info_of(2), case="")):
        pass

    with pytest.raises(RecordFileError, match="a live run without a scenario"):
        report_of(RunRecord.open(tmp_path / "case"))
