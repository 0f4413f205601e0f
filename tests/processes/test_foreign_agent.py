"""examples/foreign_agent.py, which knows our protocol from docs/protocol.md alone, among real processes of ours."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from msgspec.structs import replace

from agents.config import AgentConfig, Control
from plant.config import PlantConfig, SwitchEvent
from plant.realtime.pacer import TOLERATED
from scenarios.drivers.children import Children
from scenarios.drivers.inprocess import run_inprocess
from scenarios.drivers.outcome import Outcome
from scenarios.drivers.rendezvous import rendezvous
from scenarios.live.setup import Wishes, set_up
from scenarios.results.metrics import sharing_index
from scenarios.spec import load_scenario
from scenarios.spec.configs import configs
from tests.toy.runs import FleetRun, Rows, first_difference
from tests.toy.toy_configs import toy_configs
from tests.toy.toy_plant import ToyPlant

PROGRAM = Path(__file__).parents[2] / "examples" / "foreign_agent.py"
REAL = ("-m", "scenarios.emulation.plant")


class Mixed(FleetRun):
    """A run in which the agents of some inverters are foreign; all logs lie in one folder."""

    def __init__(
        self, plant: PlantConfig, agents: Sequence[AgentConfig], log_dir: Path, foreign: Sequence[str]
    ) -> None:
        self.endpoint = rendezvous()
        ours = [agent for agent in agents if agent.name not in foreign]
        super().__init__(replace(plant, listen=(self.endpoint,)), ours, log_dir)
        self._first = {agent.name: agent for agent in agents if agent.name in foreign}
        self.foreigners: list[subprocess.Popen[bytes]] = []

    def start(self, name: str) -> None:
        """Start a foreign agent as a person would: told by the plant in real time, by a file in simulated time."""
        wall = self.plant.clock == "wall"
        with (self.log_dir / f"{name}-foreign-{len(self.foreigners)}.log").open("wb") as log:
            options = [self.endpoint, self.plant.run, name] if wall else []
            process = subprocess.Popen([sys.executable, PROGRAM, *options], stdin=subprocess.PIPE, stderr=log)
        self.foreigners.append(process)
        assert process.stdin is not None
        with process.stdin as pipe:
            if not wall:
                pipe.write(msgspec.json.encode(replace(self._first[name], connect=(self.endpoint,))))

    def _started(self, children: Children) -> None:
        super()._started(children)
        for name in self._first:
            self.start(name)

    def __call__(self, **more: Any) -> Outcome:
        """Run, and wait for the foreign agents to end."""
        try:
            outcome = super().__call__(**more)
            for process in self.foreigners:
                process.wait(timeout=10.0)
            return outcome
        finally:
            for process in self.foreigners:
                process.kill()
                process.wait()

    def dropped(self) -> list[str]:
        """Logs of ours that tell of a message that was dropped."""
        ours = [log for log in self.log_dir.glob("*.log") if "-foreign-" not in log.name]
        return [text for log in ours if "dropped" in (text := log.read_text())]


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
    outcome = run(plant_command=("-m", "plant"))

    assert outcome.broke == ""
    assert outcome.reproducible
    assert first_difference(expected, run.rows) == ""
    assert [process.returncode for process in run.foreigners] == [0, 0]
    assert run.dropped() == []


def test_a_foreign_agent_follows_who_leaves_and_returns(tmp_path: Path) -> None:
    """Rosters change, on a graph that is not full: the same rows to the last bit."""
    moves: Any = ((0.2, "inv2", "leave"), (0.3, "inv2", "join"))
    plant, agents = toy_configs(6, Control(secondary="all", graph="clustered"), moves=moves)
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
    plant, agents = toy_configs(4, end=6.0)
    run = Mixed(plant, agents, tmp_path, foreign=("inv3",))
    run.at(0.4, lambda: run.foreigners[0].kill())
    outcome = run()

    assert outcome.broke == ""
    assert [event.subject for event in outcome.events if event.kind == "roster"] == ["inv3"]
    assert run.rows[-1][0] == 6.0
    assert run.rows[-1][1] == pytest.approx(60.0, abs=0.01)


def test_a_foreign_agent_takes_its_share_in_real_time(tmp_path: Path) -> None:
    """The feeder islands: 60 Hz, MPSI below 0.01 with the foreign one; it leaves, returns, is killed, as ours would."""
    scenario, feeder = load_scenario("islanding")
    scenario = replace(scenario, events=scenario.events[:1])
    plant, agents = set_up(scenario, feeder, Wishes(run="feeder", case="IV", duration=7.0), "tcp/127.0.0.1:0")
    standing = [agent for agent in agents if agent.name in plant.agents]
    run = Mixed(plant, standing, tmp_path, foreign=("inv2",))
    run.at(2.4, lambda: run.foreigners[0].send_signal(signal.SIGTERM))
    run.at(3.4, lambda: run.start("inv2"))
    run.at(5.6, lambda: run.foreigners[1].kill())
    outcome = run(plant_command=REAL)
    assert outcome.broke == ""
    pacing = outcome.pacing
    assert pacing is not None
    if pacing.late > TOLERATED * pacing.steps or pacing.slipped:
        pytest.skip(f"this machine is too busy for wall-clock time: {msgspec.to_builtins(pacing)}")
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


def test_the_foreign_agent_is_short_and_imports_nothing_of_ours() -> None:
    """At most 200 lines; beyond Python's own library zenoh and msgpack alone."""
    source = PROGRAM.read_text()
    imported = {line.split()[1] for line in source.splitlines() if line.startswith(("import ", "from "))}

    assert len(source.splitlines()) <= 200
    assert imported - set(sys.stdlib_module_names) == {"msgpack", "zenoh"}
