"""A flood in simulated time: ``python -m tests.resources.simulated``. The run gives the same rows, and takes longer."""

from __future__ import annotations

import hashlib
import os
import re
import tempfile
from collections import Counter
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

from msgspec.structs import replace

from gridpeers.scenarios.drivers.free_endpoint import free_endpoint
from gridpeers.scenarios.drivers.process_driver import run_processes
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.configs import configs
from gridpeers.wire.messages import Telemetry
from tests.resources.attack import Attack
from tests.resources.trial import attacking
from tests.resources.usage import log_bytes


class Flooded(NamedTuple):
    """What came of a run."""

    sha256: str
    """Hash of its rows."""
    seconds: float
    """Time from its first row to its last."""
    rejected: Counter[str]
    """Messages that plant and agents rejected, by kind."""
    log: int
    """Bytes of all logs."""


RATE = 10_000.0
"""Messages a second."""


def run(end: float, rate: float | None) -> Flooded:
    """Run the islanding to a time (s), flooded at a rate (messages a second) or not."""
    scenario, feeder = load_scenario("islanding")
    endpoint = free_endpoint()
    plant, agents = configs(scenario, feeder, "IV", endpoint)
    plant, digest = replace(plant, end=end), hashlib.sha256()
    attack = Attack(endpoint=endpoint, run=plant.run, names=plant.agents, kind="foreign", rate=rate or 0.0, star=True)

    def take(telemetry: Telemetry) -> None:
        digest.update(repr(telemetry.rows).encode())

    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        folder = Path(name)
        outcome = run_processes(
            plant, agents, folder, take,
            on_start=lambda children: rate is not None and stack.enter_context(attacking(attack, folder)) and None,
        )  # fmt: skip
        assert not outcome.broke, outcome.broke
        stack.close()
        logs = "".join(path.read_text() for path in folder.glob("*.log"))
        counts: Counter[str] = Counter()
        for kind, number in re.findall(r"'([a-z ]+)': (\d+)", logs):
            counts[kind] += int(number)
        return Flooded(digest.hexdigest(), outcome.run_s, counts, log_bytes(folder))


def main() -> None:
    """Run calm and flooded, and print both."""
    end = 40.0
    calm = run(end, None)
    print(
        f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}; {end:g} s of islanding, nine processes and the plant"
    )
    print(f"calm     {calm.seconds:6.2f} s, log {calm.log} bytes")
    flooded = run(end, RATE)
    kinds = ", ".join(f"{kind} {number}" for kind, number in flooded.rejected.most_common())
    same = "the same rows" if flooded.sha256 == calm.sha256 else "OTHER ROWS"
    print(f"flooded  {flooded.seconds:6.2f} s, log {flooded.log} bytes; {same}; rejected {kinds}")


if __name__ == "__main__":
    main()
