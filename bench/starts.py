"""How many starts of nine agents and the toy plant of the tests hang, in lock-step, with Zenoh's lowlatency or without.

Each start is a whole run of three ticks with ten processes and a recorder, in a full mesh, where most links are made
at once. It hangs if it is not through within the deadline; then the last lines say who waited for whom.

    .venv/bin/python bench/starts.py [--repeat 100] [--lowlatency] [--clock simulated]
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
from msgspec.structs import replace
from speed import machine

from tests.toy.runs import FleetRun
from tests.toy.toy_configs import ALL_FULL, toy_configs
from wire.driver import session

DEADLINE = 15.0
"""Time (s) after which a start counts as hung: on a busy machine one takes up to 4 s."""

PATCH = """
from wire.driver import session
plain = session._config
def config(*arguments):
    found = plain(*arguments)
    found["transport"]["unicast"]["lowlatency"] = True
    return found
session._config = config
"""
"""What the children run first: Python looks for a module sitecustomize on PYTHONPATH."""


def use_lowlatency(folder: Path) -> None:
    """Have this process and its children use the lowlatency transport."""
    (folder / "sitecustomize.py").write_text(PATCH)
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, (str(folder), os.environ.get("PYTHONPATH", ""))))
    exec(PATCH, {})


def start(folder: Path, clock: Any) -> tuple[float, str]:
    """Time (s) of one run, and why it broke, if it did."""
    plant, agents = toy_configs(9, ALL_FULL, end=0.06, deadline=DEADLINE)
    plant, agents = replace(plant, clock=clock), tuple(replace(agent, clock=clock) for agent in agents)
    began = monotonic()
    outcome = FleetRun(plant, agents, folder)()
    return monotonic() - began, outcome.broke


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--repeat", type=int, default=100, help="how many starts")
    parser.add_argument("--lowlatency", action="store_true", help="with Zenoh's lowlatency transport")
    parser.add_argument("--clock", choices=("simulated", "wall"), default="simulated")
    arguments = parser.parse_args()
    print(machine())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if arguments.lowlatency:
            use_lowlatency(folder)
        took, hung = [], 0
        for i in range(arguments.repeat):
            logs = folder / str(i)
            logs.mkdir()
            seconds, broke = start(logs, arguments.clock)
            took.append(seconds)
            hung += bool(broke)
            if broke:
                print(f"{i + 1}: {broke}", flush=True)
    inside = session._config((), (), False, False, session._PROFILES[arguments.clock])["transport"]["unicast"]
    p50, worst = np.percentile(took, (50, 100))
    print(
        f"lowlatency {inside['lowlatency']}, {arguments.clock}: {hung} of {arguments.repeat} starts hung; "
        f"a start and end took {p50:.2f} s (p50), {worst:.2f} s (longest)"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
