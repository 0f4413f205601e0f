"""The measures of a live run: those of its scenario as far as it went, and what people changed."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace as changed

from gridpeers.plant.equipment import Tables
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.measured_run import write_measures
from gridpeers.scenarios.results.plots.drawing import Drawing
from gridpeers.scenarios.results.record import Recorded, Recorder, canonical
from gridpeers.scenarios.results.report import plain
from gridpeers.scenarios.run_request import Request
from gridpeers.scenarios.schema import ScenarioModel, load_scenario
from gridpeers.scenarios.schema.configs import configs
from gridpeers.wire.messages import PlantEvent


def one_case() -> tuple[ScenarioModel, Tables]:
    """The islanding of the catalogue with its case IV alone, as a live run has it."""
    scenario, feeder = load_scenario("islanding")
    return changed(scenario, cases={"IV": scenario.cases["IV"]}), feeder


@pytest.fixture(scope="module")
def recorded() -> Recorded:
    """Case IV for 8 s: longer than the scenario, and with a spare inverter that nobody starts, as in a live run."""
    plant, agents = configs(*one_case(), "IV")
    settings = changed(plant.settings, spares=("inv10",))
    recorder = Recorder()
    run_inprocess(changed(plant, settings=settings, end=8.0), agents, recorder)
    return recorder.finish(8.0, plant.record_step)


def measured(
    folder: Path, recorded: Recorded, until: float = 8.0, *, driver: str = "live"
) -> tuple[dict[str, Any], str, Drawing]:
    """Case IV in metrics.json, the report, and the data of the figures, of a run that ended then (s)."""
    scenario, feeder = one_case()
    clock = "wall" if driver == "live" else "simulated"
    ran = Request(scenario=scenario, feeder=feeder, driver=driver, folder=folder, clock=clock)  # type: ignore[arg-type]
    rows = [row for row in recorded.history.table.tolist() if row[0] <= until]
    events = [event for event in recorded.events if event.t <= until]
    whole = replace(recorded, table=canonical(rows), ended=rows[-1][0], events=events)
    report, drawing = write_measures(ran, {"IV": whole}, {}, (), place="")
    return json.loads((folder / "metrics.json").read_text())["cases"]["IV"], plain(report), drawing


def test_a_live_run_that_was_left_alone_has_the_numbers_of_its_case(tmp_path: Path, recorded: Recorded) -> None:
    """The same measures as of `gridpeers run`, though it went on for longer and had a spare inverter in its columns."""
    plant, agents = configs(*one_case(), "IV")
    recorder = Recorder()
    run_inprocess(plant, agents, recorder)
    expected, _, _ = measured(tmp_path, recorder.finish(7.0, plant.record_step), driver="inprocess")
    case, report, _ = measured(tmp_path, recorded)

    for event in ("event1", "event2"):
        assert case[event] == pytest.approx(expected[event], rel=1e-6)
    assert case.keys() == expected.keys()
    assert "ours | paper's Table I\n" in report
    assert "NOTE  case IV: measured up to 7 s, where the scenario ends; the history goes on to 8.00 s\n" in report


@pytest.mark.parametrize(("hole", "windows"), [((1.5, 3.0), ["event1", "event2"]), ((3.9, 4.5), ["event2"])])
def test_rows_that_are_missing_are_told(
    tmp_path: Path, recorded: Recorded, hole: tuple[float, float], windows: list[str]
) -> None:
    """A window with a hole is measured, without the paper's numbers; one without rows at its end has none."""
    before, after = hole
    rows = [row for row in recorded.history.table.tolist() if not before < row[0] < after]
    case, report, _ = measured(tmp_path, replace(recorded, table=canonical(rows), missing=[hole]))

    assert [name for name in case if name.startswith("event")] == windows
    assert case["missing"] == [{"after_s": before, "before_s": after}]
    assert f"NOTE  case IV: rows are missing between {before:.2f} and {after:.2f} s, as the record" in report
    assert ("without numbers: event1" in report) == (windows == ["event2"])
    assert "paper's Table I" not in report


@pytest.mark.parametrize(("until", "unmeasured"), [(4.3, []), (4.1, ["event2"]), (0.01, ["event1", "event2"])])
def test_a_run_ended_early_is_measured_up_to_its_end(
    tmp_path: Path, recorded: Recorded, until: float, unmeasured: list[str]
) -> None:
    """A window that was not reached, or is too short to be steady, is named; not even two rows are too few."""
    case, report, drawing = measured(tmp_path, recorded, until)

    assert case.get("unmeasured", []) == unmeasured
    assert [event for event in ("event1", "event2") if event not in case] == unmeasured
    assert [mark.label for mark in drawing.events] == [
        label for label, t in (("event1", 1.0), ("event2", 4.0)) if t < until
    ]
    assert f"NOTE  case IV: ended at {until:.2f} s of 7 s; what is measured ends there\n" in report
    assert ("so without numbers" in report) == bool(unmeasured)


def test_commands_of_people_are_counted_and_shown_in_figures(tmp_path: Path, recorded: Recorded) -> None:
    """The report says how many, and has no numbers of the paper: its run was another one."""
    said = [("67s-67", "switch 67s-67: open at t = 2.50 s"), ("inv2", "inv2 was asked to leave at t = 2.60 s")]
    commands = [PlantEvent(t=2.5, kind="command", subject=subject, text=text) for subject, text in said]
    case, report, drawing = measured(
        tmp_path, replace(recorded, events=sorted([*recorded.events, *commands], key=lambda each: each.t))
    )

    assert case["commands"] == 2
    assert (
        f"NOTE  case IV: people gave 2 commands that may change the run (events.csv), first: {said[0][1]}\n" in report
    )
    assert "paper's Table" not in report
    assert [(mark.label, mark.t, mark.what) for mark in drawing.events[2:]] == [("", 2.5, "67s-67"), ("", 2.5, "inv2")]
    assert drawing.moves
