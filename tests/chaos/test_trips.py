"""Runs in which inverters trip are judged once these have had the time to return."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from scenarios.chaos import chaos_run
from scenarios.chaos.chaos_checks import JUDGED_S, WITHIN_S
from scenarios.chaos.chaos_folder import ChaosFolder
from scenarios.chaos.chaos_run import ChaosRow, JudgedRun, collapse_at_change, restored_from, run_scenario, run_schedule
from scenarios.chaos.disturbance import Disturbance
from scenarios.chaos.disturbed_scenario import ChaosBase
from scenarios.schema import load_scenario
from scenarios.schema.scenario_model import ScenarioModel
from tests.chaos.bases import base_in, base_named
from tests.chaos.test_campaign import SMALL
from wire.messages import PlantEvent

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
    """Who trips three times stays off: the run says who, when and why, and so does the scenario of the failure."""
    base = base_in(_file(tmp_path, 0.975))
    row = run_schedule(base, (), 1)
    failed = ChaosFolder(tmp_path, base, 0, "gridpeers chaos small").write_failure("returns", row, row)
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
    assert {"frequency", "returns"}.isdisjoint(row.passed)


@pytest.mark.parametrize(("without", "violated"), [("event1: at t = 1.018 s", set()), ("", {"frequency"})])
def test_a_collapse_that_faults_led_to_stays_a_failure(
    without: str, violated: set[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only a change that makes inverters trip without any fault of links and agents, too, excuses a run."""

    def judged(base: ChaosBase, scenario: ScenarioModel, row: ChaosRow, driver: str) -> JudgedRun:
        collapse = "event1: at t = 1.016 s" if LIE in row.schedule else without
        failed = replace(row, violated={"frequency": "too low", "links": "lost"})
        return JudgedRun(failed, collapse=collapse)

    monkeypatch.setattr(chaos_run, "_judged", judged)
    row = run_schedule(base_named("microgrid-switching"), (UNFED, LIE), 1)

    assert row.violated.keys() == violated | {"links"}
    assert bool(row.collapse) == ("frequency" not in violated)


def test_only_a_trip_within_a_control_period_comes_before_any_agent_could_act() -> None:
    """The next tick decides on what was measured after the change."""
    scenario = base_named("plug-n-play").scenario
    trip = PlantEvent(t=1.02, kind="trip", subject="inv1", text="inv1 tripped: overfrequency")

    assert collapse_at_change(scenario, [trip]) == "islanding: at t = 1.02 s inv1 tripped: overfrequency"
    assert collapse_at_change(scenario, [replace(trip, t=1.022)]) == ""
    assert collapse_at_change(scenario, [replace(trip, t=1.5), trip]) == ""
    assert collapse_at_change(scenario, []) == ""
