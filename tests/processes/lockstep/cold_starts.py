"""Start runs of many processes by hand: `python -m tests.processes.lockstep.cold_starts COUNT [AGENTS ...]`.

Each is the toy plant and as many agents, a process each, for two ticks, on a ring and on a full graph in turn. A line
each says what broke it, if anything did, and how long it took; the last says how many broke.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path
from typing import Literal

from gridpeers.agents.agent_config import Control
from gridpeers.scenarios.run_request import Outcome
from tests.toy.toy_configs import toy_configs
from tests.toy.toy_runs import ProcessRun


def cold_start(agents: int, graph: Literal["ring", "full"], folder: Path) -> Outcome:
    """Start a run with so many agents, and let it do two ticks."""
    plant, configs = toy_configs(agents, Control(secondary="all", graph=graph), end=0.04, deadline=20.0)
    return ProcessRun(plant, configs, folder)()


def main(words: list[str]) -> int:
    """Do the starts; return 1 if one broke."""
    count, *sizes = map(int, words)
    broken = 0
    for number in range(count):
        agents = (sizes or [30, 60])[number // 2 % len(sizes or [30, 60])]
        graph: Literal["ring", "full"] = "full" if number % 2 else "ring"
        folder = Path(tempfile.mkdtemp(prefix="cold-start-"))
        outcome = cold_start(agents, graph, folder)
        broken += bool(outcome.broke)
        load = os.getloadavg()[0]
        print(f"{number}: {agents} {graph}: {outcome.start_s:.1f} s, load {load:.0f} {outcome.broke}", flush=True)
    print(f"{broken} of {count} broke")
    return int(broken > 0)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    sys.exit(main(sys.argv[1:]))
