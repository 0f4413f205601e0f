"""One agent, or an array of several: ``python -m agents < agent.json``. Exit statuses: see `wire.driver.process`."""

from __future__ import annotations

import sys

from agents.agent_process import AgentProcess, run_agents
from wire.driver.process import main

if __name__ == "__main__":
    sys.exit(main("agents", "the agents of one inverter or several", AgentProcess, run_agents))
