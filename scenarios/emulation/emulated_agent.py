"""One agent or several behind emulated links: ``python -m scenarios.emulation.emulated_agent < agent.json``."""

from __future__ import annotations

import sys

from agents.agent_process import AgentProcess, run_agents
from scenarios.emulation.emulated_links import links_of
from wire.driver.process import main


def run(process: AgentProcess) -> str:
    """Take part in a run; return why an agent could not go on, or ""."""
    return run_agents(process, links_of)


if __name__ == "__main__":
    sys.exit(
        main(
            "scenarios.emulation.emulated_agent",
            "the agents of one inverter or several behind emulated links",
            AgentProcess,
            run,
        )
    )
