"""examples/foreign_agent.py, which knows our protocol from docs/protocol.md alone, among real processes of ours."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from gridpeers.agents.agent_config import Control
from gridpeers.plant.plant_config import SwitchEvent
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.configs import configs
from tests.toy.mixed import PROGRAM, Mixed
from tests.toy.toy_configs import toy_configs
from tests.toy.toy_plant import ToyPlant
from tests.toy.toy_runs import Rows, first_difference


def test_a_foreign_leader_and_follower_give_the_same_history(tmp_path: Path) -> None:
    """Case IV on the paper's feeder in simulated time: the same rows to the last bit, and nobody drops a message."""
    plant, agents = configs(*load_scenario("islanding"), "IV")
    events = (
        SwitchEvent(t=0.1, switch="13-152", action="open"),
        SwitchEvent(t=0.24, switch="60-160", action="open"),
    )
    plant = replace(plant, end=0.4, settings=replace(plant.settings, events=events))
    expected: Rows = []
    run_inprocess(plant, agents, lambda telemetry: expected.extend(telemetry.rows))
    run = Mixed(plant, agents, tmp_path, foreign=("inv1", "inv2"))
    outcome = run(plant_command=("-m", "gridpeers.plant"))

    assert outcome.broke == ""
    assert outcome.reproducible
    assert first_difference(expected, run.rows) == ""
    assert [process.returncode for process in run.foreigners] == [0, 0]
    assert run.dropped() == []


def test_a_foreign_agent_follows_who_leaves_and_returns(tmp_path: Path) -> None:
    """Rosters change, on a graph that is not full: the same rows to the last bit."""
    schedule: Any = ((0.2, "inv2", "leave"), (0.3, "inv2", "join"))
    plant, agents = toy_configs(6, Control(secondary="all", graph="clustered"), schedule=schedule)
    expected: Rows = []
    run_inprocess(plant, agents, lambda telemetry: expected.extend(telemetry.rows), plant=ToyPlant(plant))
    run = Mixed(plant, agents, tmp_path, foreign=("inv1", "inv3"))
    outcome = run()

    assert outcome.broke == ""
    assert outcome.reproducible
    assert first_difference(expected, run.rows) == ""
    assert run.dropped() == []


def test_the_run_goes_on_without_a_foreign_agent_that_is_killed(tmp_path: Path) -> None:
    """Kill -9 in simulated time: an event names it, and the run reaches its end."""
    plant, agents = toy_configs(4, end=20.0)
    run = Mixed(plant, agents, tmp_path, foreign=("inv3",))
    run.at(0.4, lambda: run.foreigners[0].kill())
    outcome = run()

    assert outcome.broke == ""
    assert [event.subject for event in outcome.events if event.kind == "roster"] == ["inv3"]
    assert run.rows[-1][0] == 20.0
    assert run.rows[-1][1] == pytest.approx(60.0, abs=0.01)


def test_the_foreign_agent_is_short_and_imports_nothing_of_ours() -> None:
    """At most 205 lines; beyond Python's own library zenoh and msgpack alone."""
    source = PROGRAM.read_text()
    imported = {line.split()[1] for line in source.splitlines() if line.startswith(("import ", "from "))}

    assert len(source.splitlines()) <= 205
    assert imported - set(sys.stdlib_module_names) == {"msgpack", "zenoh"}
