"""Sweeps that run: killed and resumed, with runs that break; the table is the same every time."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec
import pytest
from scipy.stats import binomtest

from gridpeers.plant.build import build_plant
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.results.record import Recorder
from gridpeers.scenarios.results.run_files import FolderError
from gridpeers.scenarios.run_request import Outcome
from gridpeers.scenarios.schema.configs import configs
from gridpeers.scenarios.schema.loading import load_scenario
from gridpeers.scenarios.sweep import sweep_case
from gridpeers.scenarios.sweep.study import Summary, SweepFolder, study
from gridpeers.scenarios.sweep.sweep_case import plant_at_start
from gridpeers.scenarios.sweep.sweep_reading import read_sweep
from gridpeers.wire.messages import PlantEvent
from tests.unit.scenarios.sweep.conftest import Write

MANY = '[grid]\n"gains.k_p" = [0.0005, 0.0007]\n'  # With 5 seeds 10 runs: enough that a tenth of them is not the end

BREAKING = """
[zip]
"plant.gfm.k_iv" = [5.86, 1e5, 5.86]
"plant.gfl.X_f_pu" = [0.15, 0.15, 0.001]
"""
"""The first is sound; then controllers are unstable and inverters trip; then the parameters contradict each other."""


def done(path: Path, folder: Path, **how: object) -> Summary:
    """Run a sweep in this process, unless asked otherwise."""
    plan = read_sweep(path)
    with SweepFolder(folder, plan) as opened:
        return study(plan, opened, lambda _: None, **({"jobs": 1} | how))  # type: ignore[arg-type]


def rows_of(table: Path) -> list[dict[str, str]]:
    with table.open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture
def many(sweep_file: Write) -> Path:
    """A sweep of 10 runs."""
    path = sweep_file("")
    path.write_text("seeds = 5\n" + path.read_text() + MANY)
    return path


SWEEP = "from gridpeers.cli.app import main; main()"

SLEEPERS = """
from time import sleep
from gridpeers.scenarios.sweep.workers import on_workers
try:
    for _ in on_workers([(0.0,), *[(60.0,)] * 3], 2, sleep):
        print("10 % done")
except KeyboardInterrupt:
    print("interrupted")
"""


@contextmanager
def python(code: str, *words: str, cwd: Path) -> Iterator[subprocess.Popen[str]]:
    """A program in a session of its own, as in a terminal of its own; nothing of it outlives the test."""
    line = [sys.executable, "-u", "-c", code, *words]
    with subprocess.Popen(
        line, cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as running:
        try:
            yield running
        finally:
            if running.poll() is None:
                os.killpg(running.pid, signal.SIGKILL)


def reached_a_tenth(running: subprocess.Popen[str]) -> bool:
    """Read what the command tells until a tenth of its runs is done."""
    assert running.stdout is not None
    return any(line.endswith(" % done\n") and " 0 % " not in line for line in running.stdout)


def test_a_killed_sweep_goes_on_and_gives_the_table_of_an_undisturbed_one(many: Path, tmp_path: Path) -> None:
    """Kill -9 in the middle: workers end, what was done stays, nothing is done twice, the table is equal."""
    journal = tmp_path / "killed" / "runs.jsonl"
    with python(SWEEP, "sweep", "mine.toml", "--out", "killed", "--jobs", "2", cwd=tmp_path) as running:
        assert reached_a_tenth(running)
        running.kill()
        running.communicate(timeout=60)  # workers hold the pipe: it ends with the last of them
    kept = journal.read_bytes()
    count = kept.count(b"\n")
    journal.write_bytes(kept + b'{"number":9,"status":"r')  # as if cut off in the middle of a line
    resumed = done(many, tmp_path / "killed")
    whole = done(many, tmp_path / "whole")
    numbers = [json.loads(line)["number"] for line in journal.read_text().splitlines()]

    assert 0 < count < 10
    assert resumed.before == count
    assert journal.read_bytes().startswith(kept)
    assert sorted(numbers) == list(range(10))
    assert (tmp_path / "killed" / "results.csv").read_bytes() == whole.table.read_bytes()
    assert (tmp_path / "killed" / "status.txt").read_text() == "complete\n"


def test_ctrl_c_ends_workers_without_a_word_of_theirs(tmp_path: Path) -> None:
    """Though the signal goes to all of the group; the next command finds none of them."""
    with python(SLEEPERS, cwd=tmp_path) as running:
        assert reached_a_tenth(running)
        os.killpg(running.pid, signal.SIGINT)
        assert running.communicate(timeout=50) == ("interrupted\n", "")  # it ends with the last worker


def test_ctrl_c_keeps_what_is_done_and_says_how_to_go_on(many: Path, tmp_path: Path) -> None:
    """Exit code 130 and one line."""
    with python(SWEEP, "sweep", "mine.toml", "--out", "here", "--jobs", "1", cwd=tmp_path) as running:
        assert reached_a_tenth(running)
        os.killpg(running.pid, signal.SIGINT)
        _, err = running.communicate(timeout=60)
        assert running.returncode == 130, err
    kept = (tmp_path / "here" / "runs.jsonl").read_text().count("\n")

    again = "gridpeers sweep mine.toml --out here"
    assert err == f"gridpeers: interrupted; {kept} of 10 runs are kept in here/; continue with: {again}\n"
    assert (tmp_path / "here" / "status.txt").read_text().startswith("broken: interrupted after")


def test_runs_that_break_are_rows_that_say_why(sweep_file: Write, tmp_path: Path) -> None:
    """No solution and contradicting parameters end a run, not the sweep; their indexes are empty, not zero."""
    summary = done(sweep_file(BREAKING), tmp_path / "here")
    rows = rows_of(summary.table)

    assert [row["status"] for row in rows] == ["ran", "ran", "broke"]
    assert [row["why"] for row in rows[:2]] == ["", ""]
    assert (rows[0]["trips"], rows[2]["trips"]) == ("", "")
    assert "tripped" in rows[1]["trips"]
    assert "the current controller would diverge" in rows[2]["why"]
    assert [row["event1.MPSI"] == "" for row in rows] == [False, True, True]
    assert [row["history_sha256"] == "" for row in rows] == [False, False, True]
    assert sum(summary.broke.values()) == 1


def test_links_with_faults_are_swept_and_accounted_for(sweep_file: Write, tmp_path: Path) -> None:
    """An entry of `[[link]]` by its number: what is lost is the loss's share, another seed loses others, by name."""
    path = sweep_file('"link" = [{ on = "* -> inv4", loss = 0.0 }]\n\n[grid]\n"link[0].loss" = [0.1, 0.3]\n')
    path.write_text("seeds = 2\n" + path.read_text())
    rows = rows_of(done(path, tmp_path / "here").table)

    assert [row["link[0].loss"] for row in rows] == ["0.1", "0.1", "0.3", "0.3"]
    assert [row["link_warnings"] for row in rows] == [""] * 4
    assert len({row["links_sha256"] for row in rows}) == 4
    for row in rows:
        sent, dropped = (int(float(row[name])) for name in ("links_sent", "links_dropped"))
        assert sent > 100
        assert binomtest(dropped, sent, float(row["link[0].loss"])).pvalue > 0.001


def test_a_row_is_the_run_that_the_scenario_would_give(sweep_file: Write, tmp_path: Path) -> None:
    """A sweep's sample, written as a scenario, has the history and the indexes of its row, to the last bit."""
    from gridpeers.scenarios.run import run
    from gridpeers.scenarios.run_request import Request
    from gridpeers.scenarios.schema.scenario_writing import to_toml

    path = sweep_file('[grid]\n"gains.k_p" = [0.0005, 0.0011]\n')
    summary = done(path, tmp_path / "sweep")
    (tmp_path / "one.toml").write_text(to_toml(read_sweep(path).runs[1].scenario, {}))
    scenario, feeder = load_scenario(tmp_path / "one.toml")
    (tmp_path / "run").mkdir()
    run(
        Request(scenario=scenario, feeder=feeder, driver="inprocess", folder=tmp_path / "run", lasting=False),
        lambda case, t, end: None,
    )
    metrics = json.loads((tmp_path / "run" / "metrics.json").read_text())["cases"]["IV"]
    row = rows_of(summary.table)[1]

    assert row["history_sha256"] == metrics["history_sha256"]
    reasons = metrics["event1"].pop("reasons", {})
    assert {name: row[f"event1.{name}"] for name in metrics["event1"] if name not in reasons} == {
        name: "" if value is None else repr(value) for name, value in metrics["event1"].items() if name not in reasons
    }
    assert row["event1.steady"] == str(float(not reasons))
    assert (row["sample"], row["case"], row["seed"], row["gains.k_p"]) == ("1", "IV", "1", "0.0011")


def test_a_copied_plant_gives_the_bytes_of_a_new_one() -> None:
    """Networks that a worker keeps between runs change no digit, and no run changes them."""
    scenario, feeder = load_scenario("islanding")
    plant, agents = configs(scenario, feeder, "IV")
    plant = msgspec.structs.replace(plant, end=1.5)
    hashes = set()
    for make in (build_plant, plant_at_start, plant_at_start):
        recorder = Recorder()
        run_inprocess(plant, agents, recorder, plant=make(plant))
        hashes.add(recorder.finish(1.5, plant.record_step).sha256)

    assert len(hashes) == 1


def test_a_folder_of_another_sweep_is_refused_by_name(sweep_file: Write, tmp_path: Path) -> None:
    """Another sweep, a changed one, other versions, strange files, and one in use: each is told, nothing is touched."""
    path = sweep_file('[grid]\n"gains.k_p" = [0.0005]\n')
    folder = tmp_path / "here"
    plan = read_sweep(path)
    with SweepFolder(folder, plan), pytest.raises(FolderError, match="another `gridpeers sweep` is at work in it"):
        SweepFolder(folder, plan)
    before = {file.name: file.read_bytes() for file in folder.iterdir()}

    with pytest.raises(FolderError, match="name is mine, not gains; runs is 1, not 49; fingerprint"):
        SweepFolder(folder, read_sweep("gains"))
    with pytest.raises(FolderError, match=r"or version: fingerprint is .*, not "):
        SweepFolder(folder, read_sweep(sweep_file('[grid]\n"gains.k_p" = [0.0006]\n')))
    assert {file.name: file.read_bytes() for file in folder.iterdir()} == before
    (folder / "sweep.json").write_text(before["sweep.json"].decode().replace('"numpy": "', '"numpy": "0.'))
    with pytest.raises(FolderError, match=r"or version: numpy is 0\..*, not "):
        SweepFolder(folder, plan)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "thesis.tex").write_text("")
    with pytest.raises(FolderError, match=r"it holds other files \(thesis.tex\)"):
        SweepFolder(tmp_path / "other", plan)


def test_a_damaged_line_of_the_journal_is_named(sweep_file: Write, tmp_path: Path) -> None:
    """A file that gridpeers did not write is refused, not guessed at."""
    path = sweep_file('[grid]\n"gains.k_p" = [0.0005]\n')
    done(path, tmp_path / "here")
    (tmp_path / "here" / "runs.jsonl").write_text("not a run\n")

    with pytest.raises(FolderError, match=r"runs\.jsonl:1: this line is damaged"):
        done(path, tmp_path / "here")
    (tmp_path / "here" / "runs.jsonl").write_text('{"number":0,"status":"broke"}\n{"number":1,"status":"broke"}\n')
    with pytest.raises(FolderError, match=r"runs\.jsonl:2: this study has runs 0 to 0, none 1; remove the line"):
        done(path, tmp_path / "here")


def test_what_several_islands_share_is_a_column_of_each(sweep_file: Write, tmp_path: Path) -> None:
    """Over all inverters it would mean nothing, also as a metric that the scenario asks for."""
    path = sweep_file(
        """
scenario = "islanding"
cases = ["IV"]
[set]
paper = ""
metrics = ["MPSI", "t_share_s"]
"time.end_s" = 0.3
event = [{ label = "event1", t_s = 0.1, open = ["13-152", "sw1_2"] }]
[grid]
"gains.k_p" = [0.0005]
"""
    )

    done(path, tmp_path / "new")

    (row,) = rows_of(tmp_path / "new" / "results.csv")
    assert [row.get(f"event1.{name}", "") for name in ("MPSI", "MQSI", "t_restore_s", "t_share_s")] == [""] * 4
    assert 0.0 < float(row["event1.islands.inv4.MPSI"]) < 1.0
    assert "event1.islands.inv1.MQSI" in row
    assert not row["event1.t_f_s"] or float(row["event1.t_f_s"]) > 0.0


@pytest.mark.parametrize(("on_law_failure", "status"), [("droop", "broke"), ("stop", "law failed")])
def test_a_failed_law_is_why_a_run_broke_only_where_it_ends_runs(
    on_law_failure: str, status: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With "droop" a run goes on after the failure, and something else breaks it later."""
    failed = PlantEvent(t=1.2, kind="law", subject="inv1", text="inv1: law mine: no idea")
    outcome = Outcome(
        broke="no solution", reproducible=False, events=(failed,), notes=(), ticks=60, start_s=0.0, run_s=0.0
    )
    monkeypatch.setattr(sweep_case, "run_inprocess", lambda *_, **__: outcome)
    scenario, _ = load_scenario("islanding")

    row = sweep_case.run_one(0, msgspec.structs.replace(scenario, on_law_failure=on_law_failure), "IV")

    assert (row.status, row.why) == (status, "no solution")
