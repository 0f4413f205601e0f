"""The size of a run's files is known before its start."""

import shutil
from pathlib import Path
from typing import NamedTuple

import pytest

import gridpeers as gp
from gridpeers.runs.choices import with_cases
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.results.file_sizes import file_sizes
from gridpeers.scenarios.results.record import Recorder
from gridpeers.scenarios.results.run_files import FolderError
from gridpeers.scenarios.schema.configs import configs
from tests.command_line import invoke
from tests.record.recorded_runs import recorded_run

ISLANDING = gp.load("islanding").replace({"paper": None})


class Usage(NamedTuple):
    """As `shutil.disk_usage` returns it."""

    total: int = 10**9
    used: int = 10**9
    free: int = 5_000_000


def long_run(folder: Path) -> Path:
    """A scenario file of ten minutes, four cases."""
    file = folder / "long.toml"
    file.write_text(ISLANDING.replace({"time.end_s": 600.0}).to_toml(), encoding="utf-8")
    return file


def test_the_files_of_a_run_have_about_the_size_that_was_told(tmp_path: Path) -> None:
    """history.csv and links.csv of a case with a delay on every link are near the forecast."""
    event = ISLANDING.tables["event"][0] | {"t_s": 0.1}
    changes = {"link": [{"on": "* <-> *", "delay": 0.01}], "event": [event], "time.end_s": 1.0}
    scenario = ISLANDING.replace(changes)
    plant, agents = configs(scenario.spec, scenario.feeder, "IV")
    with Recorder(tmp_path / "IV") as recorder:
        run_inprocess(plant, agents, recorder, on_other=recorder)
        recorder.finish(1.0, scenario.spec.time.record_s)

    forecast = file_sizes(with_cases(scenario.spec, ["IV"]), scenario.feeder)
    written = {path.name: path.stat().st_size for path in (tmp_path / "IV").iterdir()}

    assert forecast.history == pytest.approx(written["history.csv"], rel=0.2)
    assert forecast.links == pytest.approx(written["links.csv"], rel=0.25)


def test_links_without_a_fault_write_nothing() -> None:
    """A fault on one link counts one link; without any there is no links.csv."""
    one = ISLANDING.replace({"link": [{"on": "inv1 -> inv2", "delay": 0.01}]})
    four = with_cases(one.spec, ["IV"])

    assert file_sizes(with_cases(ISLANDING.spec, ["IV"]), one.feeder).links == 0
    assert file_sizes(four, one.feeder).links == 350 * 36


def test_a_live_run_without_an_end_is_told_by_the_hour() -> None:
    """An hour of nine inverters is 356 MB of history, whatever the scenario's own end is, and as much of record."""
    forecast = file_sizes(with_cases(ISLANDING.spec, ["IV"]), ISLANDING.feeder, 3600.0, "wall")

    assert forecast.sentence == "writes about 864 MB: history.csv 356 MB, run.mcap 508 MB"


def test_a_record_has_about_the_size_that_was_told(tmp_path: Path) -> None:
    """In simulated time, with the physics alone, and with emulated links."""
    delayed = ISLANDING.replace({"link": [{"on": "* <-> *", "delay": 0.05}]})
    for name, scenario in (
        ("all", ISLANDING),
        ("physics", ISLANDING.replace({"record": "physics"})),
        ("links", delayed),
    ):
        file = tmp_path / f"{name}.toml"
        file.write_text(scenario.to_toml(), encoding="utf-8")
        written = recorded_run(file, "IV", tmp_path / name, level=scenario.spec.record).path.stat().st_size
        forecast = file_sizes(with_cases(scenario.spec, ["IV"]), scenario.feeder)

        assert forecast.record == pytest.approx(written, rel=0.35)


def test_check_tells_the_size_of_a_long_run(tmp_path: Path) -> None:
    """Four cases of ten minutes are some 400 MB; the experiment itself is too short to speak of."""
    code, output = invoke("check", str(long_run(tmp_path)))
    assert (code, "writes about 398 MB: history.csv 238 MB, run.mcap 160 MB" in output) == (0, True)

    assert "writes" not in invoke("check", "islanding")[1]


def test_a_disk_without_room_refuses_a_run_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The line has the room that is needed and that there is; no folder is made, by the command and in Python."""
    file, out = long_run(tmp_path), tmp_path / "out"
    monkeypatch.setattr(shutil, "disk_usage", lambda path: Usage())

    code, output = invoke("run", str(file), "--driver", "inprocess", "--out", str(out))
    assert (code, "needs about 398 MB, and its disk has 5 MB left" in output.replace("\n", " ")) == (2, True)
    with pytest.raises(FolderError, match="needs about 398 MB, and its disk has 5 MB left"):
        gp.load(file).run(folder=out)
    assert not out.exists()
