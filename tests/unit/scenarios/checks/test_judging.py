"""Checks of one's own, the choice of a scenario, and what a verdict says."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any

import pytest

import gridpeers as gp
from gridpeers.scenarios.checks.check_registry import ALWAYS, CHECKS
from gridpeers.scenarios.checks.check_verdict import (
    SHOWN_VIOLATIONS,
    CheckVerdict,
    NotJudgedError,
    Violation,
    judge_by,
    read_verdicts,
    summary,
)
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.wire.plugins.plugin import Plugin, plugin_problems
from tests.unit.scenarios.checks.cases import ran

HERE = __name__

PAGE = (Path(__file__).parents[4] / "docs" / "reference" / "measures-and-checks.md").read_text(encoding="utf-8")


class Nadir:
    """No grid-forming inverter falls below a frequency."""

    least_Hz: Annotated[float, gp.Unit("Hz"), gp.Range(40, 70)] = 59.3

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        f = case.history.f[:, case.nameplates.GFM]
        for row, column in zip(*(f < self.least_Hz).nonzero(), strict=True):
            yield Violation(text="low", t=case.history.t[row], agent="inv1", value=f[row, column], limit=self.least_Hz)


def judged(check: Callable[[Any], Any], monkeypatch: pytest.MonkeyPatch) -> CheckVerdict:
    monkeypatch.setitem(vars(CHECKS)["_added"], "mine", check)
    (found,) = judge_by({"mine": Plugin(use="mine")}, ran().checked_case)
    return found


def raising(error: BaseException) -> Callable[[Any], Any]:
    def check(case: CheckedCase) -> Any:
        raise error

    return check


@pytest.mark.parametrize(
    ("check", "said"),
    [
        (lambda case: (), "mine passed"),
        (lambda case: [Violation(text="late", t=1.5, agent="inv2", value=3.0, unit="s", limit=2.0)],
         "mine failed: late: inv2 3 s at t = 1.50 s (limit 2 s)"),
        (raising(NotJudgedError("no clouds")), "mine not judged: no clouds"),
        (raising(ZeroDivisionError("division")), "mine failed: cannot judge: ZeroDivisionError: division"),
        (lambda case: None, "mine failed: cannot judge: TypeError: returned None; return violations"),
        (lambda case: True, "mine failed: cannot judge: TypeError: returned True; return violations"),
        (lambda case: "late", "mine failed: cannot judge: TypeError: returned 'late'"),
        (lambda case: ["late"], "mine failed: cannot judge: TypeError: yielded 'late'; yield a gridpeers.Violation"),
        (lambda case: case.history.t.fill(0.0), "mine failed: cannot judge: ValueError: assignment destination"),
    ],
)  # fmt: skip
def test_a_check_of_ones_own_passes_fails_or_is_not_judged(
    check: Callable[[Any], Any], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An error of the check is a failure with its reason, on one line; it may not write to the record."""
    assert judged(check, monkeypatch).sentence.startswith(said)


def test_a_verdict_counts_all_violations_and_keeps_the_first(monkeypatch: pytest.MonkeyPatch) -> None:
    found = judged(lambda case: (Violation(text=f"x{k}") for k in range(1000)), monkeypatch)

    assert (found.status, found.count, found.violations[-1].text) == ("failed", 1000, f"x{SHOWN_VIOLATIONS - 1}")


def test_a_scenario_names_checks_of_its_own_and_other_limits() -> None:
    """A class with limits beside those of every run, one with another limit, one taken out."""
    keys = ["frequency", {"use": "rating", "P_limit_pu": 0.1}, {"use": "steady", "off": True}]
    own = [{"use": f"{HERE}:Nadir", "least_Hz": 59.99}, {"use": "frequency", "name": "tight", "within_s": 0.5}]
    run = gp.load("islanding").replace({"checks": [*keys, *own], "time.end_s": 4.5}).run("IV")

    assert list(run.checks.index) == [*(name for name in ALWAYS if name != "steady"), "Nadir", "tight", "steady"]
    status = run.checks["status"]
    assert [status[name] for name in ("frequency", "rating", "Nadir", "tight")] == ["passed", *3 * ["failed"]]
    assert run.checks["limit"]["Nadir"] == 59.99
    assert (status["steady"], run.checks["text"]["steady"]) == ("off", "switched off by the scenario")
    assert ", steady switched off; " in summary(run.check_verdicts)
    assert run.check_verdicts == read_verdicts(run.folder / "checks.json")["IV"]


@pytest.mark.parametrize(
    ("entries", "said"),
    [
        (["frequncy"], 'checks[0]: there is no check "frequncy"; did you mean "frequency"?'),
        ([{"use": "frequency", "band_Hz": 60.0}], "checks[0].band_Hz: 60 Hz is not plausible for a band of frequency"),
        ([{"use": "frequency", "within": 1}], 'checks[0].within: unknown parameter; did you mean "within_s"?'),
        ([{"use": "voltage", "low_pu": 1.1, "high_pu": 0.9}], "checks[0].low_pu: 1.1 pu must be below high_pu = 0.9"),
        ([{"use": "rating", "longest_s": -1}], "checks[0].longest_s: a time of overload must not be negative, got -1"),
        ([{"use": "steady", "off": 1}], "checks[0].off: must be true or false"),
        ([{"use": "rating", "name": "a b"}], "checks[0].name: a name in the verdict is up to 41 letters"),
        (["rating", "rating"], 'checks[1]: there is a check "rating" in this list already'),
        ([{"use": "rating", "name": "steady"}], 'checks[0]: every run has a check "steady" already'),
        ([{"use": "rating", "name": "mine", "off": True}], 'checks[0].off: the check "mine" is off unless'),
        (["math:pi"], "checks[0]: math:pi is no check"),
        ([{"limit_pu": 1.0}], "checks[0]: names no check"),
    ],
)  # fmt: skip
def test_a_wrong_check_is_refused_before_anything_starts(entries: list[Any], said: str) -> None:
    """Unknown names, impossible limits, limits that contradict each other: a line each, at its key."""
    with pytest.raises(gp.ScenarioError) as error:
        gp.load("islanding").replace({"checks": entries})

    assert any(said in line for line in error.value.problems), error.value.problems


def test_gridpeers_own_checks_are_entries_like_any_other() -> None:
    """Each has a sentence, limits that its defaults keep, and its name in docs/reference/measures-and-checks.md."""
    for name in {*CHECKS.own, *ALWAYS}:
        assert re.search(rf"`(checks = \[\")?{name}(\"\])?`", PAGE), name
        assert plugin_problems(CHECKS, Plugin(use=name)) == []
        assert CHECKS.resolve(name).__doc__
