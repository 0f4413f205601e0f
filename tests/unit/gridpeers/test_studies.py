"""Sweeps, predictions and comparisons in Python."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

import pytest

import gridpeers as gp
from tests.command_line import invoke


@pytest.fixture(scope="module")
def scenario() -> gp.Scenario:
    """Half a second on either side of islanding, two cases."""
    changes = {"time.end_s": 1.0, "event": [{"label": "islanding", "t_s": 0.5, "open": ["13-152"]}]}
    return gp.load("islanding").replace({**changes, "case.II": None, "case.III": None})


@pytest.fixture(scope="module")
def runs(scenario: gp.Scenario) -> gp.Results:
    return scenario.run()


def test_a_sweep_is_a_row_per_run_with_the_metrics_asked_for(scenario: gp.Scenario) -> None:
    """Every combination of the grid, and each case."""
    table = gp.sweep(scenario, {"gains.k_p": [0.001, 0.002]}, cases=["IV"], metrics=["MPSI", "V_error"], jobs=1)

    assert table.columns.tolist() == [
        *("case", "seed", "gains.k_p", "status", "why"),
        *("islanding.MPSI", "islanding.V_error"),
    ]
    assert table["gains.k_p"].tolist() == [0.001, 0.002]
    assert table.attrs["units"]["islanding.V_error"] == "pu"


def test_a_sweep_may_ask_for_a_metric_that_the_scenario_has(
    scenario: gp.Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is measured once, whoever names it."""
    (tmp_path / "my_metrics.py").write_text("def lowest_f_Hz(window):\n    return window.f.min()\n")
    monkeypatch.syspath_prepend(tmp_path)
    own = "my_metrics:lowest_f_Hz"

    table = gp.sweep(scenario.replace({"metrics": [own]}), {"seed": [1]}, cases=["I"], metrics=["MPSI", own], jobs=1)

    assert table.columns.tolist()[3:] == ["why", "metric_warnings", "islanding.MPSI", "islanding.lowest_f_Hz"]


def test_all_problems_of_a_sweep_come_before_the_first_run(scenario: gp.Scenario) -> None:
    """Keys, values and metrics are told with what would be right."""
    with pytest.raises(gp.ScenarioError) as caught:
        gp.sweep(scenario, {"gains.kp": [1.0], "time.T_c_s": ["x", 0.02]})
    assert "sweep: grid.gains.kp: unknown key" in str(caught.value)
    assert 'grid.time.T_c_s: must be a number, got "x"' in str(caught.value)
    with pytest.raises(gp.ScenarioError, match=r"sweep: grid\.case\.IV\.graph: needs a list of values, got 'ring'"):
        gp.sweep(scenario, {"case.IV.graph": "ring"})
    with pytest.raises(gp.ScenarioError, match="needs a scenario, its name or its path, got 3"):
        gp.sweep(3, {"gains.k_p": [0.001]})  # type: ignore[arg-type]
    with pytest.raises(gp.ScenarioError, match="nothing is varied"):
        gp.sweep(scenario)
    with pytest.raises(gp.ScenarioError, match='no metric "MPSY"; did you mean "MPSI"'):
        gp.sweep(scenario, {"gains.k_p": [0.001]}, cases=["I"], metrics=["MPSY"], jobs=1)


def test_a_prediction_has_tables_and_the_words_of_the_command() -> None:
    """The frequency mode is kappa n_L/N; it is that of good links and of the paper's law, and says so."""
    found = gp.predict(gp.load("islanding"), "IV", voltage=False)

    assert found.modes["frequency_rate"] == pytest.approx(found.modes["kappa"] * 3 / 9)
    assert math.isinf(found.delay_limits["discrete"]["agent to agent"])
    assert found.times["t_restore_s"].tolist() == pytest.approx([0.64, 0.74], abs=0.02)
    assert invoke("predict", "islanding", "--case", "IV", "--no-vars") == (0, f"{found}\n")
    late = gp.load("islanding").replace({"case.IV.link": [{"on": "* <-> *", "delay": 0.1}]})
    assert "its faults of links" not in str(found)
    assert "its faults of links and nodes are left out" in str(gp.predict(late, "IV", voltage=False))
    with pytest.raises(gp.ScenarioError, match="case IV: runs the law dapi"):
        gp.predict(gp.load("islanding").replace({"case.IV.law": "dapi"}), "IV", voltage=False)
    with pytest.raises(gp.ScenarioError, match='no case "V"; did you mean "IV"'):
        gp.predict("islanding", "V")


def test_a_comparison_tells_what_differs(scenario: gp.Scenario, runs: gp.Results) -> None:
    """Changed keys, metrics of both with their difference, and a figure with a curve for each."""
    other = scenario.replace({"gains.k_p": 0.001}).run("IV")

    found = gp.compare(runs["IV"], other, names=("before", "after"))

    assert found.changes.loc["gains.k_p"].tolist() == ["0.0007", "0.001"]
    row = found.table.loc["islanding", "t_load_s"]
    assert row["difference"] == row["after"] - row["before"]
    assert not found.same
    assert [len(axes.lines) - 1 for axes in found.plot().axes] == [2, 2, 2, 2]
    assert gp.compare(runs, runs).same


def test_the_command_compare_prints_the_table_and_draws_both(
    scenario: gp.Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two folders in, a table and a figure out."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(scenario.run("I").folder, "one")
    shutil.copytree(scenario.run("IV").folder, "two")

    code, text = invoke("compare", "one", "two", "--format", "pdf")

    assert code == 0
    assert "f_error_Hz" in text
    assert "case.secondary" in text
    assert (tmp_path / "runs" / "comparison.pdf").is_file()
    Path("two").rename("latest")
    code, text = invoke("compare", "one", ".")
    assert code == 2
    assert text == "gridpeers: .: not a run folder, because it has no status.txt; latest is one\n"
    code, text = invoke("compare", "one", "nowhere")
    assert code == 2
    assert text == "gridpeers: nowhere: not a run folder, because it has no status.txt\n"


def test_runs_without_a_common_case_are_not_compared(runs: gp.Results) -> None:
    """Studies that cannot be compared are refused by name."""
    others = gp.load("islanding").replace({"time.end_s": 0.2, "event": None, "paper": ""}).run(["II", "III"])

    with pytest.raises(gp.ScenarioError, match="the runs share no case: the first has I, IV, the second II, III;"):
        gp.compare(runs, others)
    with pytest.raises(gp.ScenarioError, match="needs results or folders of runs, got 3"):
        gp.compare(runs, 3)  # type: ignore[arg-type]
    for names in (("a", "a"), ("a",)):
        with pytest.raises(gp.ScenarioError, match="two different words"):
            gp.compare(runs, runs, names=names)  # type: ignore[arg-type]
