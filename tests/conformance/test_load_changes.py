"""A load that a scenario changes, in all that a run leaves: events, verdict, explanation and what would have been."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import gridpeers as gp
from gridpeers.runs.result import Result
from tests.command_line import invoke
from tests.unit.scenarios.checks.cases import verdict

TEXT = """
[time]
end_s = 1.2
[[event]]
label = "islanding"
t_s = 0.2
open = ["13-152"]
[[event]]
label = "step"
t_s = 0.6
load = { 48 = { factor = 3 }, 76 = { P_kW = 0 } }
[case.IV]
secondary = "all"
graph = "full"
"""
SAID = "load 48 set to 630 kW and 450 kvar at nominal voltage, 3 times its table"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Result:
    """Nine agents in an island, one load of which is tripled."""
    folder = tmp_path_factory.mktemp("loads")
    (folder / "loads.toml").write_text(TEXT, encoding="utf-8")
    return gp.load(folder / "loads.toml").run("IV", folder=folder / "out")


def test_the_events_of_a_run_have_its_loads(run: Result) -> None:
    """Each is a row, at its time, with the power that the load has from then on."""
    loads = run.events[run.events["kind"] == "load"]

    assert list(zip(loads["t"], loads["subject"], strict=True)) == [(0.6, "48"), (0.6, "76")]
    assert loads["text"].iloc[0] == SAID
    P = run.history.xs("P", axis=1, level="quantity").sum(axis=1)
    assert P.loc[1.2] - P.loc[0.59] == pytest.approx(420e3 - 245e3, rel=0.2)


def test_the_balance_goes_on_with_the_loads_that_were_set(run: Result) -> None:
    """Its rows after the change have generation that the tables' loads would not take."""
    case = run.checked_case
    untold = replace(case, events=tuple(event for event in case.events if event.kind != "load"))

    assert verdict(case, "power_balance").status == "passed"
    found = verdict(untold, "power_balance")
    assert found.status == "failed"
    assert {violation.t > 0.6 for violation in found.violations} == {True}


def test_an_explanation_and_a_counterfactual_have_the_change(run: Result, elsewhere: Path) -> None:
    """A decision just after it names it; a run under other gains has it too."""
    code, text = invoke("why", str(run.folder), "inv1", "0.62")
    done = gp.counterfactual(run, replace={"gains.k_p": 0.002})

    assert code == 0, text
    assert SAID in text
    assert SAID in set(done.would_be.events["text"])
    assert done.difference is None
