"""Scenarios in Python: built, changed and checked in the same words as their files."""

from __future__ import annotations

import inspect
from collections import Counter
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gridpeers as gp
from gridpeers.cli.commands.run_command import run as command
from gridpeers.runs.choices import Pace
from gridpeers.runs.running import How
from gridpeers.scenarios.run_request import Request

LONG = "x" * 5000
TABLES = {
    "name": "mine",
    "time": {"end_s": 1.0},
    "event": [{"label": "islanding", "t_s": 0.5, "open": ["13-152"]}],
    "case": {"ring": {"secondary": "all", "graph": "ring"}},
}


def test_one_slip_is_one_problem() -> None:
    """A wrong end of the run is reported once, not for each link; a mistake of `replace` has its own line."""
    case = {"IV": {"secondary": "all", "graph": "full", "link": [{"on": "* <-> *", "loss": 0.1}]}}
    with pytest.raises(gp.ScenarioError) as caught:
        gp.Scenario(time={"end_s": "7"}, case=case)
    assert caught.value.problems == ('Scenario(...): time.end_s: must be a number, got "7"; write 7',)
    with pytest.raises(gp.ScenarioError, match=r'^replace: gain: unknown key; did you mean "gains"'):
        gp.load("islanding").replace({"gain.k_p": 0.001})
    with pytest.raises(
        gp.ScenarioError, match=r"^replace: case.IV.link\[0\].delay: .*; give case.IV.link as a list first"
    ):
        gp.load("islanding").replace({"case.IV.link[0].delay": 0.1})


def test_a_scenario_of_keyword_tables_is_the_scenario_of_the_same_file(tmp_path: Path) -> None:
    """The keys in Python are those of the file."""
    built = gp.Scenario(**TABLES)
    file = tmp_path / "mine.toml"
    file.write_text(built.to_toml())

    assert gp.load(file) == built


def test_a_problem_that_a_change_makes_elsewhere_keeps_its_line() -> None:
    """An unchanged key keeps its line in the file."""
    with pytest.raises(gp.ScenarioError, match=r"islanding\.toml:\d+: event\[1\]\.t_s"):
        gp.load("islanding").replace({"time.end_s": 2.0})


def test_numpy_values_and_classes_become_what_a_file_would_hold() -> None:
    """An array's element is a number, and a class the reference by which another process finds it."""
    scenario = gp.load("islanding").replace({"gains.k_p": np.linspace(0.001, 0.002, 2)[0]})

    assert scenario.spec.gains.k_p == 0.001
    with pytest.raises(gp.ScenarioError, match="collections:Counter is no graph"):
        gp.load("islanding").replace({"case.IV.graph": Counter})


def test_a_value_that_no_file_can_hold_is_refused_with_its_key() -> None:
    """An object without a value and a class inside a function are two problems."""

    class Inside:
        pass

    with pytest.raises(gp.ScenarioError) as caught:
        gp.load("islanding").replace({"seed": object(), "title": Inside})

    assert "replace: seed: a scenario cannot hold a value of type object" in str(caught.value)
    assert "replace: title: " in str(caught.value)
    assert "defined inside a function" in str(caught.value)


def test_every_argument_of_a_run_has_its_text_and_the_command_its_option() -> None:
    """A new argument without text or option fails here; an unknown one is refused."""
    text, options = gp.Scenario.run.__doc__ or "", inspect.signature(command).parameters

    assert [name for name in How.__annotations__ if f"\n        {name} : " not in text] == []
    assert set(Pace.__annotations__) <= set(options) & {field.name for field in fields(Request)}
    with pytest.raises(TypeError, match="sped"):
        gp.load("islanding").run("IV", sped=2.0)  # type: ignore[call-overload]


def test_a_scenario_without_events_runs_and_has_no_windows() -> None:
    """There is nothing to measure, and nothing breaks."""
    run = gp.load("islanding").replace({"event": None, "time.end_s": 0.5}).run("IV")

    assert len(run.metrics) == 0
    assert len(run.history) == 51


@pytest.mark.parametrize(("changes", "said"), [
    ({"gains.k_p": {3, "b"}}, "replace: gains.k_p: must be a number, got [3,"),
    ({"case.IV.law": {"command": [LONG]}}, "case.IV.law.command: begins with a text that cannot be the name"),
    ({"case.IV.graph": {"use": "mine:star", "k": 10**30}}, "case.IV.graph.k: a whole number has at most 64 bits"),
    ({"case.IV.link": [{"on": "* <-> *", "mine:Jam": {"folder": LONG}}]}, "must be the path of a folder"),
    ({"metrics": [{"use": "mine:low", "band": float("nan")}]}, "metrics[0].band: must be a finite number, got nan"),
])  # fmt: skip
def test_changes_to_nonsense_are_refused(changes: dict[str, Any], said: str) -> None:
    """Names that can be no file's, numbers that are too great."""
    with pytest.raises(gp.ScenarioError) as refused:
        gp.load("islanding").replace(changes)

    assert said in str(refused.value)
