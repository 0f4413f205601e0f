"""Runs in which inverters trip are judged once these have had the time to return."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from gridpeers.lab.chaos.campaign import Campaign
from gridpeers.lab.chaos.chaos_run import (
    restored_from,
    run_schedule,
)
from gridpeers.lab.chaos.disturbed_scenario import JUDGED_S, WITHIN_S
from gridpeers.scenarios.schema import load_scenario
from gridpeers.wire.messages import PlantEvent
from tests.unit.lab.chaos.bases import base_in, run_scenario
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
