"""examples/foreign_agent.py, which knows our protocol from docs/protocol.md alone, among ours in real time."""

from __future__ import annotations

import signal
from pathlib import Path

import numpy as np
from msgspec.structs import replace

from scenarios.live.live_options import LiveOptions, configure
from scenarios.results.sharing_index import sharing_index
from scenarios.schema import load_scenario
from tests.toy.mixed import Mixed

REAL = ("-m", "scenarios.emulation.emulated_plant")


def test_a_foreign_agent_takes_its_share_in_real_time(tmp_path: Path) -> None:
    """The feeder islands: 60 Hz, MPSI below 0.01 with the foreign one; it leaves, returns, is killed, as ours would."""
    scenario, feeder = load_scenario("islanding")
    scenario = replace(scenario, events=scenario.events[:1])
    endpoint = "tcp/127.0.0.1:0"
    plant, agents = configure(scenario, feeder, LiveOptions(run="feeder", case="IV", duration=7.0, speed=0.5), endpoint)
    standing = [agent for agent in agents if agent.name in plant.agents]
    run = Mixed(plant, standing, tmp_path, foreign=("inv2",))
    run.at(2.4, lambda: run.foreigners[0].send_signal(signal.SIGTERM))
    run.at(3.4, lambda: run.start("inv2"))
    run.at(5.6, lambda: run.foreigners[1].kill())
    outcome = run(plant_command=REAL)
    print(f"pace: {outcome.pacing}")
    assert outcome.broke == ""
    told = [event.text.split(",")[0].split(";")[0] for event in outcome.events if event.subject == "inv2"]
    rows = np.array(run.rows)
    s = np.array([agent.P_rated for agent in standing])
    MPSI = sharing_index(rows[:, 2::6][:, : s.size], s, np.full(s.size, 0.01))

    assert told == ["inv2 joined", "inv2 left", "inv2 disconnected", "inv2 joined", "inv2 connected", "inv2 died"]
    assert run.foreigners[0].returncode == 0
    assert run.dropped() == []
    for t in (2.3, 5.5):  # 1.3 s after the island formed, some 2 s after it came back
        row = int(np.searchsorted(rows[:, 0], t))
        assert abs(rows[row, 1] - 60.0) < 0.01
        assert MPSI[row] < 0.01
