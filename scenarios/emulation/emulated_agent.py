"""One agent or several, links emulated: ``python -m gridpeers.scenarios.emulation.emulated_agent < agent.json``."""

from __future__ import annotations

from gridpeers.agents.agent_process import AgentProcess, run_agents
from gridpeers.scenarios.emulation.emulated_links import links_of
from gridpeers.wire.driver.process import main


def run(process: AgentProcess) -> str:
    return run_agents(process, links_of)


if __name__ == "__main__":
    main("gridpeers.scenarios.emulation.emulated_agent", AgentProcess, run)
