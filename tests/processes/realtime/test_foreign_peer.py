"""Peers of other make: agents that follow the protocol, in both kinds of time."""

from __future__ import annotations

import signal
import sys
from pathlib import Path

import numpy as np
from msgspec.structs import replace

from gridpeers.plant.plant_config import SwitchEvent
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.live.live_options import configure
from gridpeers.scenarios.results.sharing_index import sharing_index
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.configs import configs
from tests.toy.mixed import PROGRAM, Mixed
from tests.toy.toy_runs import Rows, first_difference

REAL = ("-m", "gridpeers.scenarios.emulation.emulated_plant")

ISLANDED = 1.0  # Time (s) of the scenario's first event


def test_a_foreign_agent_takes_its_share_in_real_time(tmp_path: Path) -> None:
    """The feeder islands: 60 Hz, MPSI below 0.01 with the foreign one; it leaves, returns, is killed, as ours would."""
    scenario, feeder = load_scenario("islanding")
    scenario = replace(scenario, events=scenario.events[:1])
    endpoint = "tcp/127.0.0.1:0"
    plant, agents = configure(scenario, feeder, endpoint, run="feeder", case="IV", duration=45.0, speed=0.5)
    standing = [agent for agent in agents if agent.name in plant.agents]
    s = np.array([agent.P_rated for agent in standing])
    run = Mixed(plant, standing, tmp_path, foreign=("inv2",))

    def all_share(since: float) -> bool:
        """Whether the island is at 60 Hz, and all nine share, some time after they could begin to."""
        row = np.array(run.rows[-1])
        MPSI = sharing_index(row[None, 2::6][:, : s.size], s, np.full(s.size, 0.01))
        return bool(row[0] > since + 0.5 and abs(row[1] - 60.0) < 0.01 and MPSI[0] < 0.01)

    run.once(lambda: all_share(ISLANDED), lambda: run.foreigners[0].send_signal(signal.SIGTERM))
    run.once(lambda: run.time_of("inv2 disconnected") < run.rows[-1][0], lambda: run.start("inv2"))
    run.once(lambda: all_share(run.time_of("inv2 connected")), lambda: run.foreigners[1].kill())
    run.once(lambda: run.time_of("inv2 died") < run.rows[-1][0], lambda: run.child("plant").signal(signal.SIGTERM))
    outcome = run(plant_command=REAL)
    print(f"pace: {outcome.pacing}")
    assert outcome.broke == "the plant was asked to leave: SIGTERM"
    told = [event.text.split(",")[0].split(";")[0] for event in outcome.events if event.subject == "inv2"]

    assert told == ["inv2 joined", "inv2 left", "inv2 disconnected", "inv2 joined", "inv2 connected", "inv2 died"]
    assert run.foreigners[0].returncode == 0
    assert run.dropped() == []


def test_a_foreign_leader_and_follower_give_the_same_history(tmp_path: Path) -> None:
    """Case IV on the paper's feeder in simulated time: the same rows to the last bit, and nobody drops a message."""
    plant, agents = configs(*load_scenario("islanding"), "IV")
    events = (SwitchEvent(t=0.1, switch="13-152", action="open"), SwitchEvent(t=0.24, switch="60-160", action="open"))
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


def test_the_foreign_agent_is_short_and_imports_nothing_of_ours() -> None:
    """At most 205 lines; beyond Python's own library zenoh and msgpack alone."""
    source = PROGRAM.read_text()
    imported = {line.split()[1] for line in source.splitlines() if line.startswith(("import ", "from "))}

    assert len(source.splitlines()) <= 205
    assert imported - set(sys.stdlib_module_names) == {"msgpack", "zenoh"}
