"""Runs in which inverters trip are judged once these have had the time to return."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from gridpeers.lab.chaos import chaos_run
from gridpeers.lab.chaos.campaign import Campaign
from gridpeers.lab.chaos.chaos_run import (
    ChaosRow,
    Collapse,
    JudgedRun,
    collapses_at_changes,
    restored_from,
    run_schedule,
)
from gridpeers.lab.chaos.disturbed_scenario import JUDGED_S, WITHIN_S, ChaosBase, Disturbance
from gridpeers.scenarios.checks.check_verdict import CheckVerdict, Violation
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.scenario_model import ScenarioModel
from gridpeers.wire.messages import PlantEvent
from tests.unit.lab.chaos.bases import base_in, base_named, run_scenario
from tests.unit.lab.chaos.small_campaign import SMALL

TRIPS = """[protection]
enter_service_s = 1.0
trips = {{ UV1 = [{V}, 0.05] }}

[[event]]"""


def _file(folder: Path, V: float) -> Path:
    file = folder / "small.toml"
    file.write_text(SMALL.format(extra="").replace("[[event]]", TRIPS.format(V=V)), encoding="utf-8")
    return file


def test_inverters_that_return_are_judged_from_then_on(tmp_path: Path) -> None:
    """Inverter 8 trips at the islanding and once more as it returns: from its second return on, all limits hold."""
    row = run_schedule(base_in(_file(tmp_path, 0.97)), (), 1)

    assert (row.trips, row.violated) == (2, {})
    assert "returns" in row.passed
    assert row.since_s == pytest.approx(3.114, abs=0.05)


def test_inverters_that_never_return_are_named_and_the_file_shows_it_again(tmp_path: Path) -> None:
    """An inverter that trips three times stays off: the run names it, with time and reason, and so does the failure."""
    base = base_in(_file(tmp_path, 0.975))
    row = run_schedule(base, (), 1)
    failed = Campaign(base=base, seed=0, runs=9, path=tmp_path).write_failure("returns", row, row)
    again, _ = load_scenario(failed)

    assert "not back in service, inv8 tripped: undervoltage" in row.violated["returns"]
    assert row.since_s > base.changed_s(())
    assert again.time.end_s == pytest.approx(row.since_s + WITHIN_S + JUDGED_S, abs=again.time.T_c_s)
    assert run_scenario(base_in(failed)).violated == row.violated


def test_a_run_is_long_enough_for_whoever_is_off() -> None:
    """After the last trip come the time to be restored and the delay of entering service; after a return neither."""
    trip = PlantEvent(t=3.0, kind="trip", subject="inv1", text="inv1 tripped: overfrequency")
    back = replace(trip, t=9.0, text="inv1 back in service, at no load")

    assert restored_from([], 5.0) == 0.0
    assert restored_from([trip], 5.0) == 3.0 + 5.0 + WITHIN_S
    assert restored_from([trip, back], 5.0) == 9.0
    assert restored_from([trip, back, replace(trip, t=10.0)], 5.0) == 10.0 + 5.0 + WITHIN_S
    assert restored_from([replace(trip, text="inv1, substation tripped, as the island"), back], 5.0) == 9.0


UNFED = Disturbance(table="event", entry={"t_s": 0.68, "open": ["97-197"]})
"""Two microgrids island with 2357 kW on 2600 kVA: 16 ms later their network has no solution."""

LIE = Disturbance(
    table="node", entry={"name": "inv1", "from_s": 0.5, "to_s": 0.9, "lies": {"model": "freeze", "of": ["P_set"]}}
)


def test_a_collapse_before_any_agent_could_act_is_no_failure_of_control() -> None:
    """Two leaders cannot take this load at once, whatever agents do: the run says so, and all else is judged."""
    base = base_named("microgrid-switching")
    soon = replace(base.scenario, protection=replace(base.scenario.protection, enter_service=0.5))
    row = run_schedule(ChaosBase(soon, base.feeder), (UNFED,), 1)

    assert row.violated == {}
    assert row.collapse.startswith("event1: at t = 1.016 s inv1, inv2")
    assert "message_account" in row.passed
    assert {"frequency", "returns"}.isdisjoint(row.passed)  # what only the collapsed island violates is not judged


def _verdict(*agents: str) -> CheckVerdict:
    violations = tuple(Violation(text="too low", agent=agent) for agent in agents)
    return CheckVerdict(check="frequency", status="failed", violations=violations, count=len(agents))


WEST, EAST = frozenset({"inv1", "inv2"}), frozenset({"inv7"})
COLLAPSED = Collapse("event1", "event1: at t = 1.016 s inv1 tripped", WEST)


def _run(monkeypatch: pytest.MonkeyPatch, faulty: JudgedRun, plain: JudgedRun, *agents: str) -> ChaosRow:
    """The row of a run with a lie, in which these agents violate a check, and which is `plain` without the lie."""

    def judged(base: ChaosBase, scenario: ScenarioModel, row: ChaosRow, *rest: object) -> JudgedRun:
        verdict = _verdict(*agents)
        failed = replace(row, violated={"frequency": verdict.sentence, "links": "lost"})
        return (faulty if LIE in row.schedule else plain)._replace(row=failed, verdicts=(verdict,))

    monkeypatch.setattr(chaos_run, "judged", judged)
    return run_schedule(base_named("microgrid-switching"), (UNFED, LIE), 1)


ROW = ChaosRow(number=0, schedule=())
LASTS = JudgedRun(ROW, collapses=(COLLAPSED,), off=WEST)


@pytest.mark.parametrize(("faulty", "plain", "excused"), [
    (LASTS, LASTS, True),
    (LASTS, LASTS._replace(collapses=()), False),  # faults led to the collapse
    (LASTS, LASTS._replace(collapses=(COLLAPSED._replace(label="event2"),)), False),
    (LASTS, LASTS._replace(collapses=(COLLAPSED._replace(inverters=EAST),)), False),  # they took another island
    (LASTS, LASTS._replace(off=frozenset()), False),  # without faults it recovers
    (LASTS._replace(off=frozenset()), LASTS, False),  # it has recovered, and is to be restored
])  # fmt: skip
def test_only_a_collapse_that_comes_and_lasts_without_faults_excuses(
    faulty: JudgedRun, plain: JudgedRun, excused: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Inverters that a change alone makes trip, and keeps off, violate no check of what control restores."""
    row = _run(monkeypatch, faulty, plain, "inv1", "inv2")

    assert row.violated.keys() == ({"links"} if excused else {"frequency", "links"})
    assert row.collapse == (COLLAPSED.text if excused else "")


def test_a_collapse_excuses_no_other_island(monkeypatch: pytest.MonkeyPatch) -> None:
    """The violation of an island that did not collapse counts, and it alone is told."""
    row = _run(monkeypatch, LASTS, LASTS, "inv1", "inv7")

    assert row.violated["frequency"] == _verdict("inv7").sentence
    assert row.collapse == COLLAPSED.text
    assert _run(monkeypatch, LASTS, LASTS, "inv7").collapse == ""


def test_only_first_trips_within_two_control_periods_come_before_any_control() -> None:
    """The first measurement after a change is of the next tick, and what it decides acts in the period after that."""
    base = base_named("plug-n-play")
    trip = PlantEvent(t=1.04, kind="trip", subject="inv1", text="inv1 tripped: overfrequency")

    def found(*events: PlantEvent) -> list[str]:
        return [collapse.text for collapse in collapses_at_changes(base.scenario, base.feeder, events)]

    assert found(trip) == ["islanding: at t = 1.04 s inv1 tripped: overfrequency"]
    assert found(replace(trip, t=1.042)) == []
    assert found(replace(trip, t=0.5), trip) == []
    assert found(replace(trip, text="substation tripped, as the island has no solution")) == []
    assert found() == []
