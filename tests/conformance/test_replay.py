"""Runs in simulated time, replayed; and what cannot be replayed is told in one line."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

import gridpeers as gp
from gridpeers.lab.replay.recorded_process import ReplayError
from gridpeers.runs.result import Result
from gridpeers.scenarios.results.plots import run_figures
from gridpeers.wire.journal import RecordLevel
from tests.command_line import invoke
from tests.record.recorded_runs import recorded_run

SHORT = """
seed = 7
[time]
end_s = 1.0
[[event]]
label = "islanding"
t_s = 0.2
open = ["13-152"]
[[event]]
label = "load"
t_s = 0.6
load = { 48 = { factor = 1.5 }, 65 = { P_kW = 0 } }
[case.IV]
secondary = "all"
graph = "full"
[[link]]
on = "* <-> *"
loss = 0.2
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Result:
    """Nine agents for a second, a fifth of their messages lost."""
    folder = tmp_path_factory.mktemp("short")
    (folder / "short.toml").write_text(SHORT, encoding="utf-8")
    return gp.load(folder / "short.toml").run("IV", folder=folder / "out")


@pytest.fixture(autouse=True)
def _few_figures(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """The figures of a run in a folder are drawn by one test, as all of them take 2 s."""
    if "figure" not in request.node.name:
        monkeypatch.setattr(run_figures, "draw_all", lambda *_: ())


def test_a_replay_gives_the_run(run: Result) -> None:
    """Rows of the plant and states of every agent are the same within 1e-9."""
    done = gp.replay(run)

    assert done.difference is None
    assert [part.name for part in done.parts] == ["plant", *(f"inv{k}" for k in range(1, 10))]
    assert done.parts[0].count == len(run.history)
    assert {part.count for part in done.parts[1:]} == {50}


def test_a_failing_law_fails_a_counterfactual(run: Result, elsewhere: Path) -> None:
    """The command reports it above the table and exits with 1; Python warns."""
    law = "tests.conformance.laws.bad_laws:Failing"
    told = rf"inv1: law {law} \(\S*bad_laws.py:\d+\): step at t = 0.4 s raised AssertionError"

    with pytest.warns(RuntimeWarning, match=rf"what would have been, {told}"):
        done = gp.counterfactual(run, law=law)
    assert re.match(rf"FAILED  would be, case IV: {told}", str(done))

    code, text = invoke("replay", str(run.folder), "--law", law, "--out", "would")
    assert code == 1
    assert re.search(rf"^FAILED  would be, case IV: {told}", text, re.MULTILINE), text


def test_a_replay_is_written_as_a_run_with_table_and_figure(run: Result, elsewhere: Path) -> None:
    """The command prints both runs side by side, and writes a run folder."""
    code, text = invoke("replay", str(run.folder), "--set", "gains.k_p=0.002", "--out", "would")

    assert code == 0, text
    assert "short, case IV, in simulated time: gains.k_p = 0.002" in text
    assert "would be" in text
    assert isinstance(gp.read("would"), Result)
    for name in ("IV/history.csv", "metrics.json", "plots/counterfactual.png", "comparison.txt"):
        assert (elsewhere / "would" / name).stat().st_size > 100
    code, text = invoke("replay", str(run.folder))
    assert code == 0, text
    assert "The replay gives what was recorded, within 1e-9.\n" in text
    assert "NOTE" not in text


def test_a_replay_of_a_part_claims_equality_of_that_part_alone(run: Result, tmp_path: Path) -> None:
    """The sentence says that a part was compared, and notes name the rest; without a difference the exit code is 0."""
    whole = (run.folder / "IV" / "run.mcap").read_bytes()
    (tmp_path / "run.mcap").write_bytes(whole[: len(whole) * 17 // 20])

    code, text = invoke("replay", str(tmp_path))

    assert code == 0, text
    said = text.partition("The replay gives what was recorded, within 1e-9, as far as it was compared:\n")[2]
    assert "NOTE  the record lacks the last decisions" in said, text
    assert "NOTE  the file is cut off within a " in said
    assert "within 1e-9." not in text


@pytest.mark.parametrize(("words", "told"), [
    (("--without", "inv4 -> inv77"), 'there is no "inv77"'),
    (("--without", "inv4"), '"inv4" names no links'),
    (("--law", "dappi"), 'did you mean "dapi"'),
    (("--set", "gains.kp=1"), 'did you mean "k_p"'),
    (("--set", "gains.k_p"), "needs a key and its value, as gains.k_p=0.001"),
    (("--from", "0.5"), "nothing changes from then on"),
])  # fmt: skip
def test_an_impossible_change_is_refused(words: tuple[str, ...], told: str, run: Result, elsewhere: Path) -> None:
    """Each is one line with exit code 2; no folder of results remains."""
    code, text = invoke("replay", str(run.folder), *words)

    assert code == 2
    assert told in text
    assert "Traceback" not in text
    assert not list(elsewhere.glob("runs/*/*/metrics.json"))


@pytest.mark.parametrize("level", ["decisions", "physics"])
def test_a_record_without_arrivals_is_refused(level: RecordLevel, tmp_path: Path) -> None:
    """A replay needs the recorded inputs of the cores."""
    (tmp_path / "short.toml").write_text(SHORT, encoding="utf-8")
    record = recorded_run(tmp_path / "short.toml", "IV", tmp_path / "out", level=level)

    with pytest.raises(ReplayError, match=f'cannot be replayed: it was recorded with record = "{level}"'):
        gp.replay(record)
    with pytest.raises(ReplayError, match="cannot be replayed"):
        gp.counterfactual(record)


def test_the_scenario_of_a_counterfactual_gives_it_again(run: Result, tmp_path: Path) -> None:
    """Its scenario has cuts, losses and times; a run in simulated time gives the same bytes."""
    done = gp.counterfactual(run, without="inv4 <-> inv7", since=0.5, folder=tmp_path / "would")

    again = gp.load(tmp_path / "would" / "scenario.toml").run("IV")

    assert again.sha256 == done.would_be.sha256 != run.sha256
    assert again.links["fate"].eq("cut").any()


def test_the_folder_of_a_counterfactual_names_the_change(run: Result, tmp_path: Path) -> None:
    """The change is in the title of report and figures; the record's own path, driver and clock are in `[as_run]`."""
    (tmp_path / "latest").symlink_to(run.folder)

    gp.counterfactual(tmp_path / "latest", without="* <-> *", since=0.5, folder=tmp_path / "would")

    assert "IV: what would have been, without * <-> *, from 0.5 s on" in (tmp_path / "would" / "report.txt").read_text()
    as_run = tomllib.loads((tmp_path / "would" / "scenario.toml").read_text())["as_run"]
    assert as_run["replayed"] == str((run.folder / "IV" / "run.mcap").resolve())
    assert (as_run["driver"], as_run["clock"]) == ("inprocess", "simulated")
    assert as_run["changes"] == "without * <-> *, from 0.5 s on"
