"""Inverters that are off because they tripped, by the plant's own words."""

from __future__ import annotations

import pytest

import gridpeers as gp
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.results.recorded_events import tripped_by, tripped_inverters
from gridpeers.wire.messages import PlantEvent
from tests.unit.scenarios.checks.cases import verdict


@pytest.fixture(scope="module")
def tripping() -> CheckedCase:
    """Inverters 1 to 3 trip at a wrong setting of overvoltage, and return half a second later."""
    keys = {
        "protection.trips": {"OV1": (1.01, 0.1)},
        "protection.enter_service_s": 0.3,
        "checks": ["returns"],
        "time.end_s": 5.0,
        "paper": "",
        "claims": [],
    }
    return gp.load("islanding").replace(keys).run("IV").checked_case


def test_whoever_has_tripped_delivers_nothing_and_is_found(tripping: CheckedCase) -> None:
    """At each row, the inverters that are off in the record are those that the events leave tripped."""
    history, events = tripping.history, tripping.events
    assert any(tripped_by(event) for event in events)

    for row in range(0, len(history.t), 7):
        until = [event for event in events if event.t < history.t[row] - 1e-9]
        off = {name for name, on in zip(history.inverters, history.present[row], strict=True) if not on}
        assert off == set(tripped_inverters(until)), history.t[row]


def _event(text: str, kind: str = "trip", subject: str = "inv1") -> PlantEvent:
    return PlantEvent(t=1.0, kind=kind, subject=subject, text=text)  # type: ignore[arg-type]


def test_a_black_start_brings_all_back_that_it_names() -> None:
    """A collapse takes several inverters at once, a black start returns them, and a remark changes nothing."""
    off = _event("inv1, inv2 tripped, as the island has no solution: overload")
    back = _event("black start by inv1, inv2")
    remark = _event("inv1, inv2: tripped 3 times, off until the agent joins again, or a GFM joins")

    assert [*tripped_inverters([off, remark])] == ["inv1", "inv2"]
    assert tripped_inverters([off, back]) == {}
    assert [*tripped_inverters([off, back, off])] == ["inv1", "inv2"]
    assert [tripped_by(event) for event in (off, back, remark)] == [("inv1", "inv2"), (), ()]


def test_whoever_leaves_is_not_off_by_a_trip_and_whoever_waits_in_a_dead_island_has_not_tripped() -> None:
    """An agent decides for its inverter; in a dead island a grid-forming one waits for those that have tripped."""
    off = _event("inv1 tripped: underfrequency 56.4 Hz for 0.16 s (UF2: 56.5 Hz)")
    left = _event("inv1 disconnected", "inverter")
    waits = _event("inv4 starts its island, together with the inverters that have tripped", subject="inv4")

    assert tripped_inverters([off, left]) == {}
    assert [*tripped_inverters([off, waits])] == ["inv1"]
    assert tripped_by(waits) == ()


def test_a_substation_that_trips_with_inverters_is_none() -> None:
    """It never returns, and nobody waits for it."""
    both = _event("inv1, substation tripped, as the island has no solution: voltage collapse")

    assert tripped_by(both) == ("inv1",)
    assert tripped_inverters([both, _event("inv1 back in service, at no load")]) == {}
    assert tripped_by(_event("substation tripped, as the island has no solution", subject="substation")) == ()


def test_a_run_whose_inverters_are_off_at_its_end_fails(tripping: CheckedCase) -> None:
    """The check names the inverter, when it tripped and why; without a trip there is nothing to judge."""
    found = verdict(tripping, "returns")
    off = tripped_inverters(tripping.events)

    assert {it.agent for it in found.violations} == set(off)
    assert found.status == ("failed" if off else "passed")
