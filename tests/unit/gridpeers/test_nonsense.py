"""Arguments that make no sense are told in one line each, before anything is run."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import pytest

import gridpeers as gp

LONG = "x" * 5000


@pytest.fixture(scope="module")
def scenario() -> gp.Scenario:
    """A scenario of the catalogue."""
    return gp.load("islanding")


@pytest.mark.parametrize(("changes", "said"), [
    ({"gains.k_p": {3, "b"}}, "replace: gains.k_p: must be a number, got [3,"),
    ({"case.IV.law": {"command": [LONG]}}, "case.IV.law.command: begins with what can be no name of a program"),
    ({"case.IV.graph": {"use": "mine:star", "k": 10**30}}, "case.IV.graph.k: a whole number has at most 64 bits"),
    ({"case.IV.link": [{"on": "* <-> *", "mine:Jam": {"folder": LONG}}]}, "must be the path of a folder"),
    ({"metrics": [{"use": "mine:low", "band": float("nan")}]}, "metrics[0].band: must be a finite number, got nan"),
])  # fmt: skip
def test_changes_to_nonsense_are_refused(changes: dict[str, Any], said: str, scenario: gp.Scenario) -> None:
    """Names that can be no file's, numbers that are too great."""
    with pytest.raises(gp.ScenarioError) as refused:
        scenario.replace(changes)

    assert said in str(refused.value)


@pytest.mark.parametrize(("call", "said"), [
    (lambda it: gp.compare("/nowhere", "/nowhere", names=("a", "a")), "names: two different words are needed"),
    (lambda it: gp.predict(it, "V"), 'no case "V"; did you mean "IV"? The cases are I, II, III, IV'),
    (lambda it: it.run("IV", driver="process"), 'driver: there is no "process"; did you mean "processes"?'),
    (lambda it: gp.read(LONG), "needs the path of a folder, got"),
])  # fmt: skip
def test_other_nonsense_is_refused(call: Callable[[gp.Scenario], Any], said: str, scenario: gp.Scenario) -> None:
    """Unknown cases and drivers, folders that can be none."""
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
