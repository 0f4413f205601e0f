"""Arguments that make no sense are told in one line each, before anything is run."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import pytest

import gridpeers as gp

LOOP: dict[str, Any] = {}
LOOP["itself"] = LOOP
LONG = "x" * 5000
HALF = "\ud800"


@pytest.fixture(scope="module")
def scenario() -> gp.Scenario:
    """A scenario of the catalogue."""
    return gp.load("islanding")


@pytest.mark.parametrize(("how", "said"), [
    ({"jobs": "x"}, "jobs: must be a whole number, 1 or more, or None for one per core; got 'x'"),
    ({"grid": 1}, 'grid: needs lists of values by the path of their key, as {"gains.k_p": [0.001, 0.002]}, got 1'),
    ({"cases": 1}, "cases: needs a list of names, or None for all, got 1"),
    ({"progress": 3}, "progress: must be a function of two whole numbers, got 3"),
])  # fmt: skip
def test_a_sweep_of_nonsense_is_refused(how: dict[str, Any], said: str, scenario: gp.Scenario) -> None:
    """Each argument by its name, with what would be right."""
    with pytest.raises(gp.ScenarioError, match=re.escape(said)):
        gp.sweep(scenario, **{"grid": {"gains.k_p": [0.001]}} | how)


@pytest.mark.parametrize(("changes", "said"), [
    ({"case.IV.law": LOOP}, "replace: case.IV.law: tables and lists are nested more than 20 levels deep"),
    ({"gains.k_p": HALF}, "replace: gains.k_p: has half a character in it, which no file can hold"),
    ({"gains.k_p": {3, "b"}}, "replace: gains.k_p: must be a number, got [3,"),
    ({"case.IV.law": {"command": [LONG]}}, "case.IV.law.command: begins with what can be no name of a program"),
    ({"case.IV.graph": {"use": "mine:star", "k": 10**30}}, "case.IV.graph.k: a whole number has at most 64 bits"),
    ({"case.IV.link": [{"on": "* <-> *", "mine:Jam": {"folder": LONG}}]}, "must be the path of a folder"),
    ({"metrics": [{"use": "mine:low", "band": float("nan")}]}, "metrics[0].band: must be a finite number, got nan"),
])  # fmt: skip
def test_changes_to_nonsense_are_refused(changes: dict[str, Any], said: str, scenario: gp.Scenario) -> None:
    """Tables without end, texts that are none, names that can be no file's, numbers that are too great."""
    with pytest.raises(gp.ScenarioError) as refused:
        scenario.replace(changes)

    assert said in str(refused.value)


@pytest.mark.parametrize(("call", "said"), [
    (lambda it: gp.compare("/nowhere", "/nowhere", names="ab"), "names: two different words are needed"),
    (lambda it: gp.predict(it, []), 'no case "[]"; the cases are I, II, III, IV'),
    (lambda it: it.run("IV", driver=["processes"]), "driver: there is no \"['processes']\""),
    (lambda it: gp.read(LONG), "needs the path of a folder, got"),
    (lambda it: it.replace([("seed", 1)]), "replace: needs values by the path of their key"),
    (lambda it: it.run("IV", progress=3), "progress: must be a function of a case and two times, got 3"),
])  # fmt: skip
def test_other_nonsense_is_refused(call: Callable[[gp.Scenario], Any], said: str, scenario: gp.Scenario) -> None:
    """Names that are no words, cases and drivers that are no texts, folders that can be none."""
    with pytest.raises(ValueError, match=re.escape(said)):
        call(scenario)


def test_a_machine_without_room_for_temporary_files_is_told(
    scenario: gp.Scenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A result that is not saved needs a folder too."""

    def refuse(**_: str) -> str:
        raise FileNotFoundError(2, "No usable temporary directory found")

    monkeypatch.setattr("tempfile.mkdtemp", refuse)
    with pytest.raises(ValueError, match="there is nowhere for temporary files: No usable temporary directory found"):
        scenario.run("I")
