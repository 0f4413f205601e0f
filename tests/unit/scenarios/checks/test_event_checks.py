"""The check of laws: a law that fails fails the run, a run without one is not judged."""

from __future__ import annotations

from dataclasses import replace

from gridpeers.plant.plant_node import IDLE
from gridpeers.scenarios.results.recorded_events import law_failures
from gridpeers.wire.messages import PlantEvent
from tests.unit.scenarios.checks.cases import ran, verdict


def test_each_law_that_fails_is_a_violation_in_the_order_of_time() -> None:
    """It names the agent, the time, and the line of the law; agents come in the order of the inverters."""
    why = "law mine:Mine (mine.py:12): step at t = 1.2 s raised ValueError: no"
    events = [
        PlantEvent(t=t, kind="law", subject=name, text=f"{name}: {why}{IDLE}")
        for t, name in ((1.4, "inv1"), (1.2, "inv10"), (1.2, "inv2"))
    ]

    found = verdict(replace(ran().checked_case, events=tuple(events)), "law_failed")

    assert (found.status, found.count) == ("failed", 3)
    assert [(it.t, it.agent) for it in found.violations] == [(1.2, "inv2"), (1.2, "inv10"), (1.4, "inv1")]
    assert found.violations[0].text == why


def test_a_run_without_secondary_control_is_not_judged() -> None:
    """Droop alone has no law that could fail."""
    found = verdict(ran(case="I").checked_case, "law_failed")

    assert (found.status, found.reason) == ("not judged", "no inverter runs a law")


def test_the_line_of_a_failure_is_that_of_the_law_and_none_that_its_words_have() -> None:
    """A program's own words may have a place in brackets: of a program no line is known."""
    why = "law ./mylaw: answered the step at t = 1.2 s with 'no (main.c:3): no', which is none"
    (failure,) = law_failures([PlantEvent(t=1.2, kind="law", subject="inv1", text=f"inv1: {why}{IDLE}")])

    assert (failure.why, failure.line) == (why, "")
