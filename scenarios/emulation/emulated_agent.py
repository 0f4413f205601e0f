"""One agent behind emulated links: ``python -m scenarios.emulation.emulated_agent < agent.json``; else as `agents`."""

from __future__ import annotations

import sys

from agents.agent_config import AgentConfig
from agents.agent_process import run_agent
from scenarios.emulation.emulated_links import links_of
from wire.driver.process import main


def run(config: AgentConfig) -> str:
    """Take part in a run; return why the agent could not go on, or ""."""
    return run_agent(config, links_of)


if __name__ == "__main__":
    sys.exit(
        main("scenarios.emulation.emulated_agent", "the agent of one inverter behind emulated links", AgentConfig, run)
    )
