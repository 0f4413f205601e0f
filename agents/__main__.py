"""One agent: ``python -m agents < agent.json``. Exit statuses: see `wire.driver.process`."""

from __future__ import annotations

import sys

from agents.agent_config import AgentConfig
from agents.agent_process import run_agent
from wire.driver.process import main

if __name__ == "__main__":
    sys.exit(main("agents", "the agent of one inverter", AgentConfig, run_agent))
