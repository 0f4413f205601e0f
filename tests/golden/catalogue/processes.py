"""Compare the catalogue with its pins, every agent a process: `python -m tests.golden.catalogue.processes`.

Names of scenarios choose some. All cases take some six minutes; `tests/conformance` runs short ones.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from tests.pinned_kernels import choose

choose()  # before numpy is imported

from gridpeers.scenarios.drivers.free_endpoint import local_endpoint  # noqa: E402
from gridpeers.scenarios.drivers.process_driver import run_processes  # noqa: E402
from gridpeers.scenarios.results.record import Recorder  # noqa: E402
from gridpeers.scenarios.schema import load_scenario  # noqa: E402
from gridpeers.scenarios.schema.configs import configs  # noqa: E402
from tests.golden.catalogue.pins import cases, environment, read  # noqa: E402


def hash_of(name: str, case: str) -> str:
    """Return the SHA-256 of the history of one case, or why it broke."""
    scenario, feeder = load_scenario(name)
    plant, agents = configs(scenario, feeder, case, local_endpoint(0))
    recorder = Recorder()
    with tempfile.TemporaryDirectory() as folder:
        outcome = run_processes(plant, agents, Path(folder), recorder, on_other=recorder)
    return outcome.broke or recorder.finish(scenario.time.end_s, plant.record_step).sha256


def main(*chosen: str) -> int:
    """Print each case, and return 1 if the history of one is not the pinned one."""
    pinned = read()
    if environment() != pinned.environment:
        print(f"the pins are those of another environment: {pinned.environment}, here {environment()}")
    moved = 0
    for name, case in cases():
        if not chosen or name in chosen:
            found, expected = hash_of(name, case), pinned.here()[name, case].sha256
            moved += found != expected
            print(f"{name} {case}: {'as pinned' if found == expected else found}", flush=True)
    return moved > 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
