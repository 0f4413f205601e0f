"""Results in Python: the tables of a run, and the same folder as the command's."""

from __future__ import annotations

import gc
import os
import re
import shutil
from pathlib import Path

import pandas as pd
import pytest

import gridpeers as gp
from tests.command_line import invoke


@pytest.fixture(scope="module")
def scenario() -> gp.Scenario:
    """Half a second on either side of islanding, links that lose messages."""
    changes = {"time.end_s": 1.5, "event": [{"label": "islanding", "t_s": 0.5, "open": ["13-152"]}]}
    return gp.load("islanding").replace({**changes, "case.IV.link": [{"on": "* <-> *", "loss": 0.2}]})


@pytest.fixture(scope="module")
def run(scenario: gp.Scenario) -> gp.Result:
    return scenario.run("IV")


def test_metrics_events_and_links_are_those_of_the_files(run: gp.Result) -> None:
    """A row per window, an event per row, a row per message on an emulated link."""
    assert run.metrics.index.tolist() == ["islanding"]
    assert run.metrics.attrs["units"]["f_error_Hz"] == "Hz"
    assert run.events["kind"].iloc[0] == "switch"
    lost = run.links["delay"].isna()
    assert 0.1 < lost.mean() < 0.3
    assert run.links_sha256


def test_a_saved_run_is_read_back_the_same_and_has_its_figures(run: gp.Result, tmp_path: Path) -> None:
    """The folder is that of the command, and what is read from it is what was saved."""
    run.save(tmp_path / "kept")

    again = gp.read(tmp_path / "kept")

    assert isinstance(again, gp.Result)
    assert again.sha256 == run.sha256
    for table in ("history", "metrics", "events", "links"):
        pd.testing.assert_frame_equal(getattr(again, table), getattr(run, table))
    assert (tmp_path / "kept" / "plots" / "overview.png").is_file()
    assert again.report.endswith(f"Results: {tmp_path / 'kept'}/\n")


def test_a_folder_without_a_finished_run_is_refused(tmp_path: Path) -> None:
    """Another folder, and the folder of a broken run, are errors of one line."""
    with pytest.raises(gp.FolderError, match="not a run folder"):
        gp.read(tmp_path)
    with pytest.raises(gp.FolderError, match="needs the path of a folder, got"):
        gp.read("x" * 5000)
    (tmp_path / "status.txt").write_text("broken: interrupted\n")
    with pytest.raises(gp.FolderError, match='its status is "broken: interrupted"'):
        gp.read(tmp_path)


def test_several_cases_are_results_by_case(scenario: gp.Scenario) -> None:
    """A run of several cases is a mapping, with the metrics of all in one table."""
    runs = scenario.run(["I", "II"])

    assert list(runs) == ["I", "II"]
    assert runs.metrics.index.tolist() == [("I", "islanding"), ("II", "islanding")]
    assert runs["I"].sha256 != runs["II"].sha256
    assert len(runs.plot().axes) == len(runs["I"].plot().axes) == 4
    with pytest.raises(KeyError, match="no case"):
        runs["IV"]
    with pytest.raises(KeyError, match=r'no inverter "inv99".* The inverters are inv1, inv2'):
        runs["I"].history["inv99"]
    for shown in (runs, runs["I"], gp.compare(runs["I"], runs["II"])):  # as notebooks do
        assert re.search("<table.*MPSI.*</table><img .*data:image/png;base64,", shown._repr_html_(), re.DOTALL)
    with pytest.raises(ValueError, match=r'no figure "frequenzy".*did you mean "frequency"'):
        runs.plot("frequenzy")


def test_a_temporary_folder_goes_with_its_results(scenario: gp.Scenario) -> None:
    """A session with many runs leaves nothing behind."""
    run = scenario.run("I")
    folder = run.folder
    assert folder.is_dir()

    del run
    gc.collect()

    assert not folder.exists()


def test_a_run_into_a_folder_is_the_commands_folder_and_is_judged(scenario: gp.Scenario, tmp_path: Path) -> None:
    """Its files stay, with figures; findings and verdicts are those of the report. Claims that need more say so."""
    runs = scenario.run(["I", "IV"], folder=tmp_path / "mine")

    assert (tmp_path / "mine" / "plots" / "overview.png").is_file()
    assert runs.findings.results["IV"]["islanding"].V_error == runs["IV"].metrics.loc["islanding", "V_error"]
    assert runs.verdicts
    assert all(f"{verdict.status:7}  {verdict.claim.text}" in runs.report for verdict in runs.verdicts)
    with pytest.raises(gp.FolderError, match="not empty"):
        scenario.run("I", folder=tmp_path / "mine")


def test_a_file_of_a_run_that_was_spoilt_is_named(run: gp.Result, tmp_path: Path) -> None:
    """Removed, or bytes that are no text: one line with the file, whenever it is asked for."""
    folder = Path(shutil.copytree(run.folder, tmp_path / "run"))
    for name in ("IV/run.mcap", "report.txt"):
        whole = (folder / name).read_bytes()
        for spoilt in (b"\xff\x00\n", None):
            (folder / name).unlink()
            if spoilt is not None:
                (folder / name).write_bytes(spoilt)
            opened = gp.read(folder)
            assert isinstance(opened, gp.Result)
            with pytest.raises(gp.FolderError, match=f"{name}: cannot be read: .*; run the scenario again"):
                _ = (opened.history, opened.events, opened.report)
        (folder / name).write_bytes(whole)


def test_a_folder_of_any_name_is_read_and_compared(run: gp.Result, tmp_path: Path) -> None:
    """A name has bytes, and they need not be UTF-8; a table has them as escapes."""
    folder = Path(shutil.copytree(run.folder, tmp_path / os.fsdecode(b"r\xff") / "run"))

    assert gp.read(folder).sha256 == run.sha256
    code, text = invoke("compare", str(folder), str(run.folder), "--out", str(tmp_path / "c.svg"))
    assert (code, "r\\xdcff" in text) == (0, True), text


def test_a_machine_without_room_for_temporary_files_is_told(
    scenario: gp.Scenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A result that is not saved needs a folder too."""

    def refuse(**_: str) -> str:
        raise FileNotFoundError(2, "No usable temporary directory found")

    monkeypatch.setattr("tempfile.mkdtemp", refuse)
    with pytest.raises(ValueError, match="no place for temporary files: No usable temporary directory found"):
        scenario.run("I")
