"""A live run beside its scenario: what was reached, where people departed from it, and the numbers up to there."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import pytest

from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem, NodeFault
from gridpeers.plant.equipment import Tables
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.live.departures import compare
from gridpeers.scenarios.live.live_report import live_drawing, write_report
from gridpeers.scenarios.measured_run import metrics_json
from gridpeers.scenarios.results.findings import find
from gridpeers.scenarios.results.history import History, Window, windows
from gridpeers.scenarios.results.record import Recorded, Recorder, canonical
from gridpeers.scenarios.results.report import plain
from gridpeers.scenarios.run_request import Request
from gridpeers.scenarios.schema import ScenarioModel, load_scenario
from gridpeers.scenarios.schema.configs import configs
from gridpeers.scenarios.schema.scenario_model import Event, LoadChange
from gridpeers.wire.messages import PlantEvent


def one_case(name: str) -> tuple[ScenarioModel, Tables]:
    """A scenario of the catalogue with its case IV alone, as a live run has it."""
    scenario, feeder = load_scenario(name)
    return msgspec.structs.replace(scenario, cases={"IV": scenario.cases["IV"]}), feeder


def told(kind: str, t: float, subject: str, text: str) -> PlantEvent:
    """An event in the plant's words."""
    return PlantEvent(t=t, kind=kind, subject=subject, text=text)


LIVE = told("switch", 2.5, "67s-67", "switch sw1_2 (67s-67) opened")
ABSENT = told("roster", 0.0, "inv3", "started without the agents of inv3, which stay on primary droop until they come")
LEFT = told("roster", 2.3, "inv2", "inv2 left; its inverter is off the network, at t = 2.3 s")
EARLY = msgspec.structs.replace(LEFT, t=1.5)
BACK = told("roster", 3.4, "inv2", "inv2 joined, at t = 3.4 s")


@pytest.mark.parametrize(
    ("scenario", "events", "disturbed", "said"),
    [
        ("islanding", [told("switch", 1.0, "13-152", "switch 13-152 opened")], (), []),
        ("islanding", [told("switch", 2.5, "13-152", "switch 13-152 was open already")], (), []),
        ("islanding", [LIVE], ("event1", "event2"), ["2.50 s  switch sw1_2 (67s-67) opened"]),
        ("islanding", [msgspec.structs.replace(LIVE, t=5.0)], ("event2",), ["5.00 s  switch sw1_2"]),
        ("islanding", [told("roster", 0.0, "inv3", "inv3 joined, at t = 0 s")], (), []),
        ("islanding", [ABSENT], ("event1", "event2"), ["0.00 s  started without the agents of inv3"]),
        ("islanding", [told("link", 4.5, "links", "link command 1: * -> *: cut")], ("event2",), ["link command 1"]),
        (
            "islanding",
            [told("load", 5.0, "48", "load 48 set to 315 kW")],
            ("event2",),
            ["5.00 s  load 48 set to 315 kW"],
        ),
        ("plug-n-play", [LEFT, BACK], (), []),
        (
            "plug-n-play",
            [msgspec.structs.replace(LEFT, t=1.5)],
            ("islanding", "leave", "return"),
            ["1.50 s  inv2 left"],
        ),
    ],
)
def test_what_the_scenario_does_not_tell_is_found(
    scenario: str, events: list[PlantEvent], disturbed: tuple[str, ...], said: list[str]
) -> None:
    """Switches, agents and links that people moved; only windows that end later are disturbed by it."""
    compared = compare(*one_case(scenario), events, 9.0)
    lines = [f"{event.t:.2f} s  {event.text}" for event in compared.events]

    assert tuple(window.label for window in compared.disturbed) == disturbed
    assert len(lines) == len(said)
    assert all(words in line for words, line in zip(said, lines, strict=True))


def test_a_planned_switch_may_wait_for_synchronism() -> None:
    """It closes late, up to its timeout; a later closing is of people."""
    scenario, feeder = one_case("ieee34-islanding")
    row = next(each for each in feeder.switches if each.alias == "sw1_2")
    closed, late = (told("switch", t, row.event_name, f"switch {row.full_name} closed") for t in (10.5, 18.5))

    assert compare(scenario, feeder, [closed, late], 20.0).events == (late,)


def test_a_load_that_the_scenario_sets_is_none_of_the_people() -> None:
    """At its time, by its bus; the same load at another time, and another one then, are of people."""
    scenario, feeder = one_case("islanding")
    event = Event(label="load", t_s=5.0, load={"48": LoadChange(factor=1.5)})
    planned = msgspec.structs.replace(scenario, events=(*scenario.events, event))
    mine = told("load", 5.0, "48", "load 48 set to 315 kW")
    later, other = msgspec.structs.replace(mine, t=5.5), msgspec.structs.replace(mine, subject="65")

    assert compare(planned, feeder, [mine], 9.0).events == ()
    assert compare(planned, feeder, [mine, other, later], 9.0).events == (other, later)


def test_a_death_that_the_scenario_tells_of_is_none_of_the_people() -> None:
    """An agent killed as `[[node]]` says is the scenario's; another one that dies is not."""
    scenario, feeder = one_case("islanding")
    killed = msgspec.structs.replace(scenario, netem=Netem(nodes=(NodeFault(name="inv3", kill=True, from_s=2.0),)))
    inv3, inv4 = (told("roster", 2.04, name, f"{name} died; its inverter stays on droop") for name in ("inv3", "inv4"))

    assert compare(killed, feeder, [inv3], 9.0).events == ()
    assert compare(killed, feeder, [inv3, inv4], 9.0).events == (inv4,)


@pytest.mark.parametrize(
    ("netem", "disturbed"),
    [
        (Netem(), ("event2",)),
        (Netem(nodes=(NodeFault(name="inv3", pause=True, from_s=5.2, to_s=5.7),)), ()),
        (Netem(links=(Fault(on="plant -> inv3", cut=True, from_s=5.0, to_s=5.4),)), ()),
        (Netem(links=(Fault(on="plant -> inv3", cut=True, from_s=1.0, to_s=2.0),)), ("event2",)),
    ],
)
def test_a_silence_disturbs_its_window_unless_the_scenario_brings_it_about(
    netem: Netem, disturbed: tuple[str, ...]
) -> None:
    """Frozen or cut off for real: the window is flagged, unless a fault of the scenario acts then."""
    text = "inv3 is silent: no state for 0.25 s, nothing comes from it, at t = 5.5 s"
    scenario, feeder = one_case("islanding")
    scenario = msgspec.structs.replace(scenario, netem=netem)
    again = told("roster", 6.0, "inv3", "inv3 is heard again, at t = 6 s")
    compared = compare(scenario, feeder, [told("roster", 5.5, "inv3", text), again], 9.0)

    assert tuple(window.label for window in compared.disturbed) == disturbed
    assert [event.text for event in compared.events] == ([text] if disturbed else [])


def switch(t: float, what: str = "opened", name: str = "sw1_2 (67s-67)") -> PlantEvent:
    """A switch that somebody operated."""
    return told("switch", t, "67s-67", f"switch {name} {what}")


@pytest.mark.parametrize(
    ("events", "ended", "measured", "unmeasured"),
    [
        # in the middle of a window, which ends there; its own ends with the scenario's next event
        ([switch(2.5)], 7.0, "event1 1-2.5, live at 2.5 s 2.5-4, event2 4-7", ""),
        # before all events, and after the scenario's end: the last one of the scenario is not the longer for it
        ([switch(0.4), switch(9)], 12.0, "live at 0.4 s 0.4-1, event1 1-4, event2 4-7, live at 9 s 9-12", ""),
        # a run that ends early: what people ended was reached, and theirs ends with the run
        ([switch(2.5)], 3.0, "event1 1-2.5, live at 2.5 s 2.5-3", "event2"),
        # too little time to measure anything that is steady
        ([switch(1.1), switch(6.9)], 7.0, "live at 1.1 s 1.1-4, event2 4-6.9", "event1, live at 6.9 s"),
        # at the moment of an event of the scenario, a switch is part of that; one that was open already is nothing
        ([switch(1.0), switch(2.0, "was open already")], 7.0, "event1 1-4, event2 4-7", ""),
    ],
)
def test_a_live_switch_opens_a_window_as_the_scenarios_events_do(
    events: list[PlantEvent], ended: float, measured: str, unmeasured: str
) -> None:
    """Each window lasts to the next event, whoever made it; its label says by whom."""
    opened = compare(*one_case("islanding"), events, ended)

    assert ", ".join(f"{one.label} {one.start:g}-{one.end:g}" for one in opened.measured) == measured
    assert ", ".join(one.label for one in opened.unmeasured) == unmeasured


@pytest.fixture(scope="module")
def recorded() -> Recorded:
    """Case IV for 8 s: longer than the scenario, and with a spare inverter that nobody starts, as in a live run."""
    plant, agents = configs(*one_case("islanding"), "IV")
    settings = msgspec.structs.replace(plant.settings, spares=("inv10",))
    recorder = Recorder()
    run_inprocess(msgspec.structs.replace(plant, settings=settings, end=8.0), agents, recorder)
    return recorder.finish(8.0, plant.record_step)


def case_of(history: History, opened: Sequence[Window], events: Sequence[PlantEvent]) -> CheckedCase:
    scenario, feeder = one_case("islanding")
    return CheckedCase(scenario=scenario, feeder=feeder, case="IV", history=history, windows=opened, events=events)


def account(folder: Path, recorded: Recorded, until: float) -> tuple[dict[str, Any], str]:
    """metrics.json and report of a live run that ended then (s)."""
    scenario, feeder = one_case("islanding")
    ran = Request(scenario=scenario, feeder=feeder, driver="live", folder=folder, clock="wall")
    rows = [row for row in recorded.history.table.tolist() if row[0] <= until]
    events = tuple(event for event in recorded.events if event.t <= until)
    whole = replace(recorded, table=canonical(rows), ended=rows[-1][0], events=events)
    report = write_report(ran, whole, None, figures=False)
    return json.loads((folder / "metrics.json").read_text()), plain(report)


def test_a_live_run_that_was_left_alone_has_the_numbers_of_its_case(tmp_path: Path, recorded: Recorded) -> None:
    """The same measures as of `gridpeers run`, though it went on for longer and had a spare inverter in its columns."""
    scenario, feeder = one_case("islanding")
    plant, agents = configs(scenario, feeder, "IV")
    recorder = Recorder()
    run_inprocess(plant, agents, recorder)
    history = recorder.finish(7.0, plant.record_step).history
    came = windows([("event1", 1.0), ("event2", 4.0)], 7.0)
    found = find({"IV": case_of(history, came, recorder.case.events)})
    ran = Request(scenario=scenario, feeder=feeder, driver="inprocess", folder=tmp_path)
    expected = json.loads(metrics_json(ran, found, {"IV": {}}))["cases"]["IV"]
    metrics, report = account(tmp_path, recorded, 8.0)

    for event in ("event1", "event2"):
        assert metrics["cases"]["IV"][event] == pytest.approx(expected[event], rel=1e-6)
    assert metrics["live"] == {**{"ended_s": 8.0, "windows": {}, "unmeasured": [], "disturbed": [], "departures": []}}
    assert "ours | paper's Table I\n" in report
    assert "NOTE  case IV: measured up to 7 s, where the scenario ends; the history goes on to 8.00 s\n" in report


@pytest.mark.parametrize(
    ("missing", "measured", "disturbed"),
    [((1.5, 3.0), ["event1", "event2"], ["event1"]), ((3.9, 4.5), ["event2"], ["event2"])],
)
def test_rows_that_are_missing_flag_their_windows(
    tmp_path: Path, recorded: Recorded, missing: tuple[float, float], measured: list[str], disturbed: list[str]
) -> None:
    """A window with a hole is measured but not clean; one without rows at its end has no numbers. Both are told."""
    before, after = missing
    rows = [row for row in recorded.history.table.tolist() if not before < row[0] < after]
    holed = replace(recorded, table=canonical(rows), missing=(missing,))
    metrics, report = account(tmp_path, holed, 8.0)

    assert [name for name in metrics["cases"]["IV"] if name.startswith("event")] == measured
    assert metrics["live"]["disturbed"] == disturbed
    assert metrics["live"]["missing"] == [{"after_s": before, "before_s": after}]
    assert f"NOTE  case IV: rows are missing between {before:.2f} and {after:.2f} s, as the record" in report
    assert ("event1 (1 to 4 s)" in report) == (measured == ["event2"])
    assert "paper's Table I" not in report


@pytest.mark.parametrize(
    ("until", "measured", "said"),
    [
        (
            5.0,
            ["event1"],
            "event2 (4 to 7 s)",
        ),
        (0.01, [], "event1 (1 to 4 s), event2 (4 to 7 s)"),
    ],
)
def test_a_run_ended_early_says_what_it_did_not_reach(
    tmp_path: Path, recorded: Recorded, until: float, measured: list[str], said: str
) -> None:
    """Numbers of whole windows only, and one line on the others; not even two rows are too few."""
    metrics, report = account(tmp_path, recorded, until)
    case = metrics["cases"]["IV"]

    assert [name for name in case if name.startswith("event")] == measured
    assert metrics["live"]["unmeasured"] == ["event1", "event2"][len(measured) :]
    why = "not reached, too short, or without rows, so without numbers"
    assert f"NOTE  case IV: ended at {until:.2f} s; {why}: {said}\n" in report


@pytest.fixture(scope="module")
def switched() -> Recorded:
    """Case IV for 8.5 s, in which somebody opened the tie of microgrids 1 and 2 at 2.5 s and closed it at 7.5 s."""
    scenario, feeder = one_case("islanding")
    mine = [Event(label="a", t_s=2.5, open=("sw1_2",)), Event(label="b", t_s=7.5, close=("sw1_2",))]
    events = tuple(sorted((*scenario.events, *mine), key=lambda event: event.t_s))
    longer = msgspec.structs.replace(scenario.time, end_s=8.5)
    plant, agents = configs(msgspec.structs.replace(scenario, events=events, time=longer), feeder, "IV")
    recorder = Recorder()
    run_inprocess(plant, agents, recorder)
    return recorder.finish(8.5, plant.record_step)


def test_what_people_switched_is_measured_as_a_scenario_with_the_same_events_is(
    tmp_path: Path, switched: Recorded
) -> None:
    """The same numbers as if the scenario had had their events; the report says whose they are."""
    scenario, feeder = one_case("islanding")
    came = [("event1", 1.0), ("live at 2.5 s", 2.5), ("event2", 4.0), ("live at 7.5 s", 7.5)]
    whole = case_of(switched.history, windows(came, 8.5), switched.events)
    ran = Request(scenario=scenario, feeder=feeder, driver="inprocess", folder=tmp_path)
    expected = json.loads(metrics_json(ran, find({"IV": whole}), {"IV": {}}))["cases"]["IV"]
    metrics, report = account(tmp_path, switched, 8.5)
    case = metrics["cases"]["IV"]

    assert list(case)[:4] == [label for label, _ in came]
    assert case["live at 7.5 s"]["MPSI"] == pytest.approx(expected["live at 7.5 s"]["MPSI"], rel=1e-6)
    assert list(case["live at 2.5 s"]["islands"]) == ["inv1", "inv4"]
    assert metrics["live"]["windows"] == {
        "live at 2.5 s": {"t_s": 2.5, "end_s": 4.0, "what": "switch sw1_2 (67s-67) opened"},
        "live at 7.5 s": {"t_s": 7.5, "end_s": 8.5, "what": "switch sw1_2 (67s-67) closed"},
    }
    assert metrics["live"]["disturbed"] == ["event1", "event2"]
    assert "\nlive at 2.5 s  IV" in report
    assert "live at 2.5 s: switch sw1_2 (67s-67) opened; live at 7.5 s: switch sw1_2 (67s-67) closed" in report
    assert "paper's Table" not in report


def test_figures_have_the_islands_that_a_person_made(switched: Recorded) -> None:
    """From the moment at which the tie is opened to that at which it is closed; the scenario tells of neither."""
    scenario, feeder = one_case("islanding")
    departures = compare(scenario, feeder, switched.events, switched.ended)
    drawing = live_drawing(departures, CheckedCase.of(scenario, feeder, "IV", switched))
    intervals = drawing.island_intervals["IV"]

    assert [(it.start, it.end, list(it.islands)) for it in intervals] == [
        (2.5, 4.0, ["inv1", "inv4"]),
        (4.0, 7.5, ["inv1", "inv4"]),
    ]
    assert [drawing.island_title(island) for island in drawing.most_islands("IV").values()] == [
        "microgrid 1",
        "island of inv4",
    ]
