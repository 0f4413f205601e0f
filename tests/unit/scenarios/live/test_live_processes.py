"""What a live run's terminal shows and refuses, and what is measured of it at its end."""

from __future__ import annotations

import dataclasses
import json
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar, cast

import msgspec
import pytest
from msgspec.structs import replace

from gridpeers.agents.agent_config import Control, LawChoice
from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem
from gridpeers.plant.equipment import Tables
from gridpeers.plant.known_names import COMPILING, LISTENING
from gridpeers.scenarios import measured_run
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.emulation.link_data import EmulationConfig
from gridpeers.scenarios.live import live_processes
from gridpeers.scenarios.live.live_options import folders
from gridpeers.scenarios.live.live_processes import UNHEARD, LiveRecorder, ProcessOutcome, _followed, meaning
from gridpeers.scenarios.live.run_address import RunAddress, UsageError
from gridpeers.scenarios.live.run_requests import own_code
from gridpeers.scenarios.measured_run import write_measures
from gridpeers.scenarios.results.plots.drawing import Drawing, drawing_of
from gridpeers.scenarios.results.record import Recorded, Recorder, canonical
from gridpeers.scenarios.results.report import plain
from gridpeers.scenarios.run_request import Request
from gridpeers.scenarios.schema import ScenarioModel, load_scenario
from gridpeers.scenarios.schema.configs import configs
from gridpeers.wire.messages import PlantEvent
from gridpeers.wire.plugins.plugin import Plugin
from tests.toy.toy_configs import agent_config, toy_configs


def test_a_refused_handshake_is_told_without_the_words_of_zenoh() -> None:
    """Its reason stays; colours of a terminal, thread and hint go."""
    config, _ = toy_configs(2)
    line = (
        "\x1b[2m2026-11-23T09:08:43.534631Z\x1b[0m \x1b[33m WARN\x1b[0m app-0 ThreadId(02) "
        "\x1b[2mzenoh_link_tls::unicast\x1b[0m\x1b[2m:\x1b[0m peer sent no certificates. "
        "Hint: increase the system open file limit."
    )

    assert meaning(line, config) == "a link was refused: peer sent no certificates"
    assert meaning(LISTENING, config) == ""
    assert "is being built" in meaning(COMPILING, config)


SETUP = EmulationConfig(
    netem=Netem(links=(Fault(on="* -> *", own=(Plugin(use="mine:Jammer"),)),)), microgrids={"inv1": "MG1"}
)
CONTROL = Control(secondary="all", graph="mine:star", own_graph=Plugin(use="mine:star"), law=LawChoice(use="mine:Mine"))
CONFIG = replace(agent_config("inv1"), control=CONTROL, links=SETUP.to_tree())


def test_what_is_not_gridpeers_own_is_named() -> None:
    """Law, graph and faults by module:Name; what is registered or installed is on this host anyway."""
    calm = replace(CONTROL, own_graph=None, law=LawChoice(use="dapi"))

    assert tuple(own_code(CONFIG)) == ("the law mine:Mine", "the graph mine:star", "the link fault mine:Jammer")
    assert tuple(own_code(replace(CONFIG, control=calm, links={}))) == ()


@pytest.mark.parametrize(("endpoint", "trusts", "runs"), [
    ("tcp/127.0.0.1:7447", False, True),
    ("tcp/192.168.1.10:7447", False, False),
    ("tcp/192.168.1.10:7447", True, True),
])  # fmt: skip
def test_code_of_a_plant_on_another_host_is_run_only_if_it_is_trusted(
    endpoint: str, trusts: bool, runs: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever can pose as a plant would else have any program run on every host that joins."""
    ran: list[str] = []
    where = RunAddress(run="demo", connect=(endpoint,))
    monkeypatch.setattr(
        live_processes, "RunClient", lambda where: nullcontext(type("V", (), {"find_plant": lambda *_: None})())
    )
    monkeypatch.setattr(live_processes, "free_configurations", lambda client, names, wait: [CONFIG])
    monkeypatch.setattr(
        live_processes, "run_agents", lambda process, links: ran.extend(config.name for config in process) or ""
    )
    monkeypatch.setattr(live_processes, "stop_at_signals", lambda *_: None)

    if runs:
        live_processes.agent_here(where, ("inv1",), None, 1.0, trusts=trusts)
    else:
        with pytest.raises(
            UsageError, match=r"inv1: the plant of run demo .* names the law mine:Mine and .*--own-code"
        ):
            live_processes.agent_here(where, ("inv1",), None, 1.0, trusts=trusts)
    assert ran == (["inv1"] if runs else [])


def test_a_run_of_which_nothing_was_heard_has_failed() -> None:
    """Its plant ended well by its own account: no link to it was made, so nobody knows what it did."""

    class DeafRecorder:
        """A recorder to which nothing came."""

        failure, recorded, client = "", None, SimpleNamespace(pacing=None, latest=None)
        failed_laws: ClassVar[dict[str, object]] = {}

        def __enter__(self) -> DeafRecorder:
            return self

        def __exit__(self, *_: object) -> None:
            """End as a recorder that writes no files."""

    outcome = _followed(cast("LiveRecorder", DeafRecorder()), lambda: "")

    assert outcome.broke == UNHEARD


def test_a_run_that_is_interrupted_while_it_is_judged_has_its_scenario(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its numbers are missing; the scenario that it began with can be run again."""

    def interrupted(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(measured_run, "write_measures", interrupted)
    scenario, _ = load_scenario("islanding")
    scenario = msgspec.structs.replace(scenario, cases={"IV": scenario.cases["IV"]})
    outcome = ProcessOutcome(recorded=cast(Recorded, SimpleNamespace(ended=2.01)))
    with folders(tmp_path / "live", scenario) as kept:
        assert kept.whole == tmp_path / "live"
        ended = live_processes.conclude(outcome, cast(Request, SimpleNamespace(scenario=scenario, folder=kept.whole)))

    assert load_scenario(tmp_path / "live" / "scenario.toml")[0] == scenario
    assert ended.interrupted == "SIGINT"
    assert (tmp_path / "live" / "status.txt").read_text() == "broken: interrupted while it was measured\n"


def one_case() -> tuple[ScenarioModel, Tables]:
    """The islanding of the catalogue with its case IV alone, as a live run has it."""
    scenario, feeder = load_scenario("islanding")
    return replace(scenario, cases={"IV": scenario.cases["IV"]}), feeder


@pytest.fixture(scope="module")
def recorded() -> Recorded:
    """Case IV for 8 s: longer than the scenario, and with a spare inverter that nobody starts, as in a live run."""
    plant, agents = configs(*one_case(), "IV")
    settings = replace(plant.settings, spares=("inv10",))
    recorder = Recorder()
    run_inprocess(replace(plant, settings=settings, end=8.0), agents, recorder)
    return recorder.finish(8.0, plant.record_step)


def measured(
    folder: Path, recorded: Recorded, until: float = 8.0, *, driver: str = "live"
) -> tuple[dict[str, Any], str, Drawing]:
    """Case IV in metrics.json, the report, and the data of the figures, of a run that ended then (s)."""
    scenario, feeder = one_case()
    clock = "realtime" if driver == "live" else "simulated"
    ran = Request(scenario=scenario, feeder=feeder, driver=driver, folder=folder, clock=clock)  # type: ignore[arg-type]
    rows = [row for row in recorded.history.table.tolist() if row[0] <= until]
    events = [event for event in recorded.events if event.t <= until]
    whole = dataclasses.replace(recorded, table=canonical(rows), ended=rows[-1][0], events=events)
    report, cases = write_measures(ran, {"IV": whole}, {}, (), place="")
    return json.loads((folder / "metrics.json").read_text())["cases"]["IV"], plain(report), drawing_of(scenario, cases)


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
    assert "NOTE  case IV: measured up to 7 s, the end of the scenario; the history goes on to 8.00 s\n" in report


@pytest.mark.parametrize(("hole", "windows"), [((1.5, 3.0), ["event1", "event2"]), ((3.9, 4.5), ["event2"])])
def test_rows_that_are_missing_are_told(
    tmp_path: Path, recorded: Recorded, hole: tuple[float, float], windows: list[str]
) -> None:
    """A window with a hole is measured, without the paper's numbers; one without rows at its end has none."""
    before, after = hole
    rows = [row for row in recorded.history.table.tolist() if not before < row[0] < after]
    case, report, _ = measured(tmp_path, dataclasses.replace(recorded, table=canonical(rows), missing=[hole]))

    assert [name for name in case if name.startswith("event")] == windows
    assert case["missing"] == [{"after_s": before, "before_s": after}]
    assert f"NOTE  case IV: rows are missing between {before:.2f} and {after:.2f} s: the plant" in report
    assert ("no numbers for event1" in report) == (windows == ["event2"])
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
    assert f"NOTE  case IV: ended at {until:.2f} s of 7 s; the measures end there\n" in report
    assert ("no numbers for event" in report) == bool(unmeasured)


def test_commands_of_people_are_counted_and_shown_in_figures(tmp_path: Path, recorded: Recorded) -> None:
    """The report says how many, and has no numbers of the paper: its run was another one."""
    said = [("67s-67", "switch 67s-67: open at t = 2.50 s"), ("inv2", "inv2 was asked to leave at t = 2.60 s")]
    commands = [PlantEvent(t=2.5, kind="command", subject=subject, text=text) for subject, text in said]
    case, report, drawing = measured(
        tmp_path, dataclasses.replace(recorded, events=sorted([*recorded.events, *commands], key=lambda each: each.t))
    )

    assert case["commands"] == 2
    assert f"NOTE  case IV: people gave 2 commands (events.csv), first: {said[0][1]}\n" in report
    assert "paper's Table" not in report
    assert [(mark.label, mark.t, mark.what) for mark in drawing.events[2:]] == [("", 2.5, "67s-67"), ("", 2.5, "inv2")]
    assert drawing.moves
