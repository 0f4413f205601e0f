"""Islands of tables, figures and checks: those that the plant recorded, not those that the scenario plans."""

from __future__ import annotations

from dataclasses import replace
from math import inf

import numpy as np
import pytest
from msgspec.structs import replace as with_fields

import gridpeers as gp
from gridpeers.plant.equipment.connectivity import islands_after
from gridpeers.scenarios.results.history import Window
from gridpeers.scenarios.results.island_membership import island_intervals, islands_at_end, switch_events
from gridpeers.scenarios.results.plots.run_figures import figures_of, measured
from gridpeers.scenarios.schema import load_scenario
from gridpeers.wire.messages import PlantEvent
from tests.unit.scenarios.checks.cases import ran, verdict

TIE = {"inv1": ("inv1", "inv2", "inv3", "inv4", "inv5", "inv6"), "inv7": ("inv7", "inv8", "inv9")}
"""Islands that the open switch sw2_3 leaves, by name."""


@pytest.fixture(scope="module")
def waiting() -> gp.Result:
    """Two islands at 60 Hz, whose switch waits until the end of the run: their voltages are 2.7 % apart."""
    events = [
        {"label": "islanding", "t_s": 0.4, "open": ["13-152"]},
        {"label": "parting", "t_s": 1.0, "open": ["sw2_3"]},
        {"label": "rejoining", "t_s": 2.0, "close": ["sw2_3"], "synchronised": True},
    ]
    keys = {"event": events, "time.end_s": 3.0, "plant.sync_check.V_pu": 0.02, "paper": ""}
    return gp.load("islanding").replace(keys).run("IV")


def test_a_switch_that_never_closes_leaves_two_islands_in_the_tables(waiting: gp.Result) -> None:
    """Each has its own measures, and what is shared has none over both, though the scenario plans one island."""
    assert waiting.events.kind.tolist()[-1] == "warning"
    assert list(waiting.islands.index) == [(window, name) for window in ("parting", "rejoining") for name in TIE]
    assert waiting.islands.MPSI["rejoining"].max() < 0.001
    assert np.isnan(waiting.metrics.MPSI["rejoining"])
    assert "MPSI" not in waiting.metrics.reasons["rejoining"]


def test_a_switch_that_never_closes_leaves_two_islands_in_the_figures(waiting: gp.Result) -> None:
    """They show the worse of both to the end of the run, and each alone in a figure of its own."""
    drawing = waiting.drawing()

    assert [(it.start, it.end) for it in drawing.island_intervals["IV"]] == [(1.0, inf)]
    assert {name: island.inverters for name, island in drawing.most_islands("IV").items()} == TIE
    assert "microgrids_IV" in figures_of(drawing)
    errors = np.abs(waiting.record.V[-1] / drawing.nameplates.V_nom - 1.0)
    assert measured(drawing, "IV", "V_error")[-1] == max(errors[:6].mean(), errors[6:].mean())


def test_a_switch_that_closes_late_makes_an_island_that_is_judged_from_then_on(waiting: gp.Result) -> None:
    """Until then each island shares for itself; then the window has the island of its end, and no row of before."""
    case = waiting.checked_case
    late = PlantEvent(t=2.2, kind="switch", subject="97s-97", text="switch sw2_3 (97s-97) closed in step", closed=True)
    closed = replace(case, events=(*case.events, late))
    *_, (part,) = closed.parts.values()

    assert [len(parts) for parts in case.parts.values()] == [1, 2, 2]
    assert [len(parts) for parts in closed.parts.values()] == [1, 2, 1]
    assert part.history.t[closed.rows_from(part, 0.5)][0] == pytest.approx(2.7)
    assert {verdict(of, "power_sharing", after_s=0.5).status for of in (case, closed)} == {"passed"}


def _operated(t: float, text: str) -> PlantEvent:
    closed = "closed" in text
    return PlantEvent(t=t, kind="switch", subject="97s-97", text=f"switch sw2_3 (97s-97) {text}", closed=closed)


def test_a_window_has_the_islands_of_its_end() -> None:
    """Its steady values are of then; what operates at the very end belongs to the next window."""
    scenario, feeder = load_scenario("islanding")
    names = tuple(name for members in TIE.values() for name in members)
    events = [_operated(1.0, "opened"), _operated(2.5, "closed in step"), _operated(3.0, "opened")]
    intervals = island_intervals(scenario, feeder, names, events)

    assert [(it.start, it.end, len(it.islands)) for it in intervals] == [
        (-inf, 1.0, 1),
        (1.0, 2.5, 2),
        (2.5, 3.0, 1),
        (3.0, inf, 2),
    ]
    found = [len(islands_at_end(intervals, Window(label="", start=1.0, end=end))) for end in (2.0, 2.5, 3.0, 3.1)]
    assert found == [2, 2, 1, 2]


@pytest.mark.parametrize("name", ["microgrid-switching", "plug-n-play"])
def test_without_a_wait_the_islands_are_those_that_the_scenario_plans(name: str) -> None:
    """Switches that operate on time leave what the scenario says, event by event."""
    case = ran(name, "IV").checked_case
    planned = islands_after(case.feeder, ((event.open, event.close) for event in case.scenario.events))
    bus_of = {row.name: row.bus for row in (*case.feeder.inverters, *case.feeder.spares)}
    names = case.history.inverters

    for event, islands in zip(case.scenario.events, planned, strict=True):
        members = {tuple(name for name in names if bus_of[name] in buses) for buses in islands}
        found = {
            part.history.inverters for window, of in case.parts.items() if window.label == event.label for part in of
        }
        assert found == members - {()}


def test_a_federations_plant_that_tells_of_no_switch_does_what_the_scenario_asks() -> None:
    """Only there: of our own plant no event means no operation."""
    case = ran("islanding").checked_case
    scenario = case.scenario
    outside = with_fields(scenario, plant=with_fields(scenario.plant, simulator="helics"))

    assert switch_events(scenario, case.feeder, ()) == ()
    assert [event.subject for event in switch_events(outside, case.feeder, ())] == ["13-152", "60-160"]
