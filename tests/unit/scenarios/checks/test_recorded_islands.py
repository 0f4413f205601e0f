"""Islands as checks judge them: those that the plant recorded, not those that the scenario plans."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest
from msgspec.structs import replace as with_fields

from gridpeers.plant.equipment.connectivity import islands_after
from gridpeers.scenarios.checks.checked_case import CheckedCase, IslandWindow
from gridpeers.scenarios.results.island_membership import closed_switches, switch_events
from gridpeers.wire.messages import PlantEvent
from tests.unit.scenarios.checks.cases import ran, verdict


def _parts(case: CheckedCase, label: str) -> Sequence[IslandWindow]:
    return next(parts for window, parts in case.parts.items() if window.label == label)


def _islands(case: CheckedCase, label: str) -> set[tuple[str, ...]]:
    return {part.history.inverters for part in _parts(case, label)}


@pytest.fixture(scope="module")
def waiting() -> CheckedCase:
    """IEEE 34 without control: two switches are to close in step at 8 s, and one of them waits until it gives up."""
    return ran("ieee34-islanding", "I").checked_case


def test_a_switch_that_waits_for_ever_leaves_two_islands(waiting: CheckedCase) -> None:
    """Each shares for itself, though the scenario plans one island: nobody can share across an open switch."""
    alone, rest = ("inv1", "inv2", "inv3"), ("inv4", "inv5", "inv6", "inv7", "inv8", "inv9")

    assert _islands(waiting, "rejoining") == {alone, rest}
    assert verdict(waiting, "power_sharing").status == "passed"
    assert "rejoining, island of inv4" in {it.label for it in _parts(waiting, "rejoining")}


def test_a_switch_that_closes_late_makes_an_island_that_is_judged_from_then_on(waiting: CheckedCase) -> None:
    """The window has the island of its end, and no row of before."""
    text = "switch sw1_2 (832-832s) closed in step"
    late = PlantEvent(t=11.0, kind="switch", subject="832-832s", text=text, closed=True)
    closed = replace(waiting, events=(*waiting.events, late))
    (part,) = _parts(closed, "rejoining")

    assert len(_islands(closed, "rejoining")) == 1
    assert part.history.t[closed.rows_from(part, 2.0)][0] == pytest.approx(13.0)
    assert verdict(closed, "power_sharing").status == "failed"


@pytest.mark.parametrize("name", ["microgrid-switching", "plug-n-play"])
def test_without_a_wait_the_islands_are_those_that_the_scenario_plans(name: str) -> None:
    """Switches that operate on time leave what the scenario says, event by event."""
    case = ran(name, "IV").checked_case
    planned = islands_after(case.feeder, ((event.open, event.close) for event in case.scenario.events))
    bus_of = {row.name: row.bus for row in (*case.feeder.inverters, *case.feeder.spares)}
    names = case.history.inverters

    for event, islands in zip(case.scenario.events, planned, strict=True):
        members = {tuple(name for name in names if bus_of[name] in buses) for buses in islands}
        assert _islands(case, event.label) == members - {()}


def test_an_operation_without_effect_leaves_a_switch_as_it_was() -> None:
    """A table of events has no positions: its words say them, also of a switch that was open already."""
    feeder = ran("microgrid-switching").checked_case.feeder
    texts = ("opened", "was open already", "closed in step: 1.0 deg", "was closed already", "opened")
    events = [PlantEvent(t=1.0, kind="switch", subject="67s-67", text=f"switch sw1_2 (67s-67) {it}") for it in texts]

    found = ["67s-67" in closed_switches(feeder, events[: i + 1]) for i in range(len(events))]

    assert found == [False, False, True, True, False]


def test_a_federations_plant_that_tells_of_no_switch_does_what_the_scenario_asks() -> None:
    """Only there: of our own plant no event means no operation."""
    case = ran("islanding").checked_case
    scenario = case.scenario
    outside = with_fields(scenario, plant=with_fields(scenario.plant, simulator="helics"))

    assert switch_events(scenario, case.feeder, ()) == ()
    assert [event.subject for event in switch_events(outside, case.feeder, ())] == ["13-152", "60-160"]
