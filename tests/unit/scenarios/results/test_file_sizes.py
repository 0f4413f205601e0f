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


def test_a_record_has_about_the_size_that_was_told(tmp_path: Path) -> None:
    """In simulated time, and with emulated links."""
    delayed = ISLANDING.replace({"link": [{"on": "* <-> *", "delay": 0.05}]})
    for name, scenario in (
        ("all", ISLANDING),
        ("links", delayed),
    ):
        file = tmp_path / f"{name}.toml"
        file.write_text(scenario.to_toml(), encoding="utf-8")
        written = recorded_run(file, "IV", tmp_path / name, level=scenario.spec.record).path.stat().st_size
        forecast = file_sizes(with_cases(scenario.spec, ["IV"]), scenario.feeder)

        assert forecast.record == pytest.approx(written, rel=0.35)


def test_a_disk_without_room_refuses_a_run_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The line has the room that is needed and that there is; no folder is made, by the command and in Python."""
    file, out = long_run(tmp_path), tmp_path / "out"
    monkeypatch.setattr(shutil, "disk_usage", lambda path: Usage())

    code, output = invoke("run", str(file), "--driver", "inprocess", "--out", str(out))
    assert (code, "needs about 398 MB, and its disk has 5 MB left" in output.replace("\n", " ")) == (2, True)
    with pytest.raises(FolderError, match="needs about 398 MB, and its disk has 5 MB left"):
        gp.load(file).run(folder=out)
    assert not out.exists()
