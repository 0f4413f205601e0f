"""Histories of the catalogue are pinned: nothing moves them but a change of behaviour, with its reason."""

from __future__ import annotations

from pathlib import Path

import pytest

from gridpeers.scenarios.checks.check_verdict import judge_case
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.schema import load_scenario
from tests.golden.catalogue.pins import cases, environment, ran, read, run_case

PINNED = read()
PINS = PINNED.here()


@pytest.mark.parametrize(("name", "case"), cases())
def test_a_case_gives_the_pinned_history(name: str, case: str) -> None:
    """Every case gives the pinned bytes; without a pin of this numerical environment, the pinned last row to 1e-7."""
    pin = run_case(name, case)

    if environment() == PINNED.environment and PINS[name, case].sha256:
        assert pin == PINS[name, case], 'if it should move: python -m tests.golden.catalogue.pin "the reason"'
    else:
        assert pin.last == pytest.approx(PINS[name, case].last, rel=1e-7, abs=1e-4)


@pytest.mark.parametrize(("name", "case"), cases())
def test_a_case_fails_those_checks_that_it_is_built_to_fail(name: str, case: str, tmp_path: Path) -> None:
    """The key `expected_failures` tells the truth; `stale_values` needs a record of messages, not made here."""
    scenario, feeder = load_scenario(name)
    found = judge_case(CheckedCase.of(scenario, feeder, case, ran(name, case)[0], tmp_path))
    failed = {verdict.check for verdict in found if verdict.status == "failed"}

    assert failed == set(scenario.cases[case].expected_failures) - {"stale_values"}


def test_every_case_is_pinned_and_nothing_else() -> None:
    """A new case is pinned with its first commit, and a removed one leaves no pin behind."""
    assert set(PINNED.pins) == set(PINS) == set(cases())


def f_error(case: str) -> float:
    """Frequency error (Hz) of the first inverter at the end of a case."""
    return abs(PINNED.pins["hostile", case].last[0] - 60.0)


def test_one_liar_holds_the_frequency_of_the_paper_s_law_off_nominal() -> None:
    """Five times the band of 0.01 Hz, with all values plausible in form; a small lie does it too, past plausibility."""
    assert f_error("truth") < 1e-4
    assert f_error("one") > 0.05
    assert f_error("small") > 0.03


def test_each_defence_stops_what_it_is_made_for_and_no_more() -> None:
    """Plausibility stops a large lie; W-MSR stops F liars on a robust graph, not F + 1, and not on the sparse graph."""
    assert max(f_error(case) for case in ("plausible", "trimmed", "two-trimmed")) < 1e-3
    assert f_error("two") > 0.05
    assert f_error("sparse") > 0.05
