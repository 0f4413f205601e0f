"""One agent, or an array of several: ``python -m gridpeers.agents < agent.json``.

Exit statuses: see `gridpeers.wire.driver.process`.
"""

from __future__ import annotations

from gridpeers.agents.agent_process import AgentProcess, run_agents
from gridpeers.wire.driver.process import main

if __name__ == "__main__":
    main("gridpeers.agents", AgentProcess, run_agents)
