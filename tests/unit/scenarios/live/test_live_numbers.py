"""A run by hand beside its scenario: what was reached, where people departed from it, and the numbers up to there."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import msgspec
import pytest

from netem.spec.netem import Netem
from netem.spec.node import NodeFault
from plant.equipment import Feeder
from scenarios.drivers.inprocess import run_inprocess
from scenarios.live.book import Book
from scenarios.live.numbers.account import Account
from scenarios.live.numbers.departures import compare
from scenarios.results.findings import find
from scenarios.results.history import History, Plates
from scenarios.results.numbers import Ran, metrics_json
from scenarios.results.record import Recorded, Tape
from scenarios.results.report import plain
from scenarios.spec import Scenario, load_scenario
from scenarios.spec.configs import configs
from scenarios.spec.netem import netem_of, setup_of
from wire.messages import PlantEvent


def one_case(name: str) -> tuple[Scenario, Feeder]:
    """A scenario of the catalogue with its case IV alone, as a run by hand has it."""
    scenario, feeder = load_scenario(name)
    return msgspec.structs.replace(scenario, cases={"IV": scenario.cases["IV"]}), feeder


def told(kind: str, t: float, subject: str, text: str) -> PlantEvent:
    """An event in the plant's words."""
    return PlantEvent(t=t, kind=kind, subject=subject, text=text)


BY_HAND = told("switch", 2.5, "67s-67", "switch sw1_2 (67s-67) opened")
ABSENT = told("roster", 0.0, "inv3", "started without the agents of inv3, which stay on primary droop until they come")
LEFT = told("roster", 2.3, "inv2", "inv2 left; its inverter is off the network, at t = 2.3 s")
BACK = told("roster", 3.4, "inv2", "inv2 joined, at t = 3.4 s")


@pytest.mark.parametrize(
    ("scenario", "events", "disturbed", "said"),
    [
        ("islanding", [told("switch", 1.0, "13-152", "switch 13-152 opened")], (), []),
        ("islanding", [told("switch", 2.5, "13-152", "switch 13-152 was open already")], (), []),
        ("islanding", [BY_HAND], ("event1", "event2"), ["2.50 s  switch sw1_2 (67s-67) opened"]),
        ("islanding", [msgspec.structs.replace(BY_HAND, t=5.0)], ("event2",), ["5.00 s  switch sw1_2"]),
        ("islanding", [msgspec.structs.replace(BY_HAND, t=8.0)], (), ["8.00 s  switch sw1_2"]),
        ("islanding", [told("roster", 0.0, "inv3", "inv3 joined, at t = 0 s")], (), []),
        ("islanding", [told("roster", 0.0, "inv10", "inv10 joined, at t = 0 s")], ("event1", "event2"), ["inv10"]),
        ("islanding", [ABSENT], ("event1", "event2"), ["0.00 s  started without the agents of inv3"]),
        ("islanding", [told("link", 4.5, "links", "order 1 to links: * -> *: cut")], ("event2",), ["order 1 to"]),
        ("plug-n-play", [LEFT, BACK], (), []),
        ("plug-n-play", [LEFT], ("return",), ["3.00 s  inv2 was to join, and nobody started it in time"]),
        ("plug-n-play", [], ("leave", "return"), ["2.00 s  inv2 was to leave", "3.00 s  inv2 was to join"]),
        (
            "plug-n-play",
            [LEFT, msgspec.structs.replace(BACK, t=2.8), BACK],
            ("leave", "return"),
            ["2.80 s  inv2 joined"],
        ),
    ],
)
def test_what_the_scenario_does_not_tell_is_found(
    scenario: str, events: list[PlantEvent], disturbed: tuple[str, ...], said: list[str]
) -> None:
    """Switches, agents and links that people moved, or did not; only windows that end later are disturbed by it."""
    compared = compare(*one_case(scenario), events, 9.0)
    lines = [f"{event.t:.2f} s  {event.text}" for event in compared.departures]

    assert compared.disturbed == disturbed
    assert len(lines) == len(said)
    assert all(words in line for words, line in zip(said, lines, strict=True))


def test_a_death_that_the_scenario_tells_of_is_none_of_the_people() -> None:
    """An agent killed as `[[node]]` says is the scenario's; another one that dies is not, nor that one's return."""
    scenario, feeder = one_case("islanding")
    killed = msgspec.structs.replace(scenario, netem=Netem(nodes=(NodeFault(name="inv3", kill=True, from_s=2.0),)))
    inv3, inv4 = (told("roster", 2.04, name, f"{name} died; its inverter stays on droop") for name in ("inv3", "inv4"))
    back = told("roster", 3.0, "inv3", "inv3 joined, at t = 3 s")

    assert compare(killed, feeder, [inv3], 9.0).departures == ()
    assert compare(killed, feeder, [inv3, inv4, back], 9.0).departures == (inv4, back)
    assert [event.text for event in compare(killed, feeder, [], 9.0).departures] == [
        "inv3 was to be killed, and was not"
    ]


@pytest.mark.parametrize(
    ("ended", "whole", "end"),
    [(0.5, 0, 7.0), (3.99, 0, 7.0), (4.0, 1, 4.0), (6.99, 1, 4.0), (7.0, 2, 7.0), (60.0, 2, 7.0)],
)
def test_windows_count_once_they_are_reached_to_their_end(ended: float, whole: int, end: float) -> None:
    """What is measured ends with the last whole window, wherever the run does; the others are named."""
    scenario, feeder = one_case("islanding")
    compared = compare(scenario, feeder, [], ended)

    assert compared.measured.events == scenario.events[:whole]
    assert compared.measured.time.end_s == end
    assert [window.label for window in compared.not_reached] == ["event1", "event2"][whole:]


@pytest.fixture(scope="module")
def recorded() -> Recorded:
    """Case IV for 8 s: longer than the scenario, and with a spare inverter that nobody starts, as by hand."""
    plant, agents = configs(*one_case("islanding"), "IV")
    settings = msgspec.structs.replace(plant.settings, spares=("inv10",))
    tape = Tape()
    run_inprocess(msgspec.structs.replace(plant, settings=settings, end=8.0), agents, tape)
    return tape.finish(8.0, plant.record_step)


def account(folder: Path, recorded: Recorded, until: float) -> tuple[dict[str, Any], str]:
    """What metrics.json and the report say of a run by hand that ended then (s)."""
    scenario, feeder = one_case("islanding")
    ran = Ran(scenario=scenario, feeder=feeder, driver="by hand", folder=folder, clock="wall")
    links = setup_of(netem_of(scenario, "IV"), scenario, feeder, real_nodes=True).to_text()
    given = Account(ran, Book(scenario, feeder, links, None, None, None))
    rows = [row for row in recorded.rows if row[0] <= until]
    events = tuple(event for event in recorded.events if event.t <= until)
    given(msgspec.structs.replace(recorded, rows=rows, events=events), None)
    report = given.write()
    return json.loads((folder / "metrics.json").read_text()), plain(report)


def test_a_run_by_hand_that_was_left_alone_has_the_numbers_of_its_case(tmp_path: Path, recorded: Recorded) -> None:
    """The same measures as of `gridpeers run`, though it went on for longer and had a spare inverter in its columns."""
    scenario, feeder = one_case("islanding")
    plant, agents = configs(scenario, feeder, "IV")
    tape = Tape()
    run_inprocess(plant, agents, tape)
    history = History.of(tuple(row.name for row in feeder.inverters), tape.rows)
    found = find(
        scenario, feeder, Plates.of(feeder.inverters), {"IV": history}, {"IV": [("event1", 1.0), ("event2", 4.0)]}
    )
    ran = Ran(scenario=scenario, feeder=feeder, driver="inprocess", folder=tmp_path)
    expected = json.loads(metrics_json(ran, found, {"IV": ""}, {}))["cases"]["IV"]
    metrics, report = account(tmp_path, recorded, 8.0)

    for event in ("event1", "event2"):
        assert metrics["cases"]["IV"][event] == pytest.approx(expected[event], rel=1e-6)
    assert metrics["by_hand"] == {"ended_s": 8.0, "not_reached": [], "disturbed": [], "departures": []}
    assert "ours | paper's Table I\n" in report
    assert "NOTE  case IV: measured up to 7 s, where the scenario ends; the history goes on to 8 s\n" in report
    assert len(list((tmp_path / "plots").glob("*.png"))) == 7


@pytest.mark.parametrize(
    ("until", "measured", "said"),
    [
        (5.0, ["event1"], "ended at 5 s, before the end of event2 (4 to 7 s): they have no numbers"),
        (0.01, [], "ended at 0.01 s, before the end of event1 (1 to 4 s), event2 (4 to 7 s): nothing was measured"),
    ],
)
def test_a_run_ended_early_says_what_it_did_not_reach(
    tmp_path: Path, recorded: Recorded, until: float, measured: list[str], said: str
) -> None:
    """Numbers of whole windows only, and one line on the others; not even two rows are too few."""
    metrics, report = account(tmp_path, recorded, until)
    case = metrics["cases"]["IV"]

    assert [name for name in case if name.startswith("event")] == measured
    assert metrics["by_hand"]["not_reached"] == ["event1", "event2"][len(measured) :]
    assert f"NOTE  case IV: {said}\n" in report
