"""Runs in which the agents of some inverters are examples/foreign_agent.py, which knows our protocol from its page."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.scenarios.drivers.children import Children
from gridpeers.scenarios.drivers.free_endpoint import free_endpoint
from gridpeers.scenarios.run_request import Outcome
from tests.toy.toy_runs import ProcessRun

PROGRAM = Path(__file__).parents[2] / "examples" / "foreign_agent.py"


class Mixed(ProcessRun):
    """A run in which the agents of some inverters are foreign; all logs lie in one folder."""

    def __init__(
        self, plant: PlantConfig, agents: Sequence[AgentConfig], log_dir: Path, foreign: Sequence[str]
    ) -> None:
        self.endpoint = free_endpoint()
        ours = [agent for agent in agents if agent.name not in foreign]
        super().__init__(replace(plant, listen=(self.endpoint,)), ours, log_dir)
        self._first = {agent.name: agent for agent in agents if agent.name in foreign}
        self.foreigners: list[subprocess.Popen[bytes]] = []

    def start(self, name: str) -> None:
        """Start a foreign agent as a person would: the plant configures it in real time, a file in simulated time."""
        realtime = self.plant.clock == "realtime"
        with (self.log_dir / f"{name}-foreign-{len(self.foreigners)}.log").open("wb") as log:
            options = [self.endpoint, self.plant.run, name] if realtime else []
            process = subprocess.Popen([sys.executable, PROGRAM, *options], stdin=subprocess.PIPE, stderr=log)
        self.foreigners.append(process)
        assert process.stdin is not None
        with process.stdin as pipe:
            if not realtime:
                pipe.write(msgspec.json.encode(replace(self._first[name], connect=(self.endpoint,))))

    def _started(self, children: Children) -> None:
        super()._started(children)
        for name in self._first:
            self.start(name)

    def __call__(self, **more: Any) -> Outcome:
        try:
            outcome = super().__call__(**more)
            for process in self.foreigners:
                process.wait(timeout=60.0)
            return outcome
        finally:
            for process in self.foreigners:
                process.kill()
                process.wait()

    def dropped(self) -> list[str]:
        ours = [log for log in self.log_dir.glob("*.log") if "-foreign-" not in log.name]
        return [text for log in ours if "dropped" in (text := log.read_text())]
