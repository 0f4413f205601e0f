"""What mutual TLS with access rules costs: a tick in lock-step, and the one-way time of a message at the rate of ticks.

Both are measured beside open links, round by round, so that a ratio holds whatever else the machine does. Lock-step:
the paper's islanding, case IV, a process for each of nine agents; the time from the first row to the last. One way:
two agents, one message of the size of a State every 20 ms, median and 99th percentile of each round; with TLS alone
too, to tell what of the difference the rules make.

    .venv/bin/python -m bench.security [--rounds 5] [--end 4.0] [--messages 250]
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from statistics import median, quantiles

from msgspec.structs import replace

from bench.harness import machine, options, ratios, say
from bench.ping import one_way
from scenarios.drivers.free_endpoint import free_endpoint
from scenarios.drivers.process_driver import run_processes
from scenarios.drivers.secured import secured
from scenarios.schema import load_scenario
from scenarios.schema.configs import configs
from wire.keys import Keys
from wire.trust.credentials import Credentials
from wire.trust.key_folder import open_credentials
from wire.trust.site_authority import issue, make_site

SIZE = 119
"""Bytes of a State."""


def lock_step(folder: Path, end: float, keys: Path | None) -> float:
    """Return the time (s) of a run, from its first row to its last."""
    scenario, feeder = load_scenario("islanding")
    protocol = "tcp" if keys is None else "tls"
    plant, agents = configs(scenario, feeder, "IV", f"{protocol}/127.0.0.1:0")
    plant = replace(plant, end=end)
    if keys is not None:
        names = tuple(row.name for row in feeder.inverters)
        plant, agents, _ = secured(plant, agents, keys, started=names, inverters=names)
    outcome = run_processes(plant, agents, folder, lambda telemetry: None)
    if outcome.broke:
        raise RuntimeError(outcome.broke)
    return outcome.run_s


def latencies(count: int, keys: Path | None, *, rules: bool = True) -> list[float]:
    """Return the one-way times (s) of so many messages from inv1 to inv2, over TLS if there are keys."""
    protocol = "tcp" if keys is None else "tls"
    shown: dict[str, Credentials | None] = dict.fromkeys(("inv1", "inv2"))
    if keys is not None:
        shown = {name: open_credentials(keys, ("agent",), name)[0] for name in shown}
    return one_way(
        SIZE,
        count,
        key=Keys("bench").state("inv1"),
        receiver=(free_endpoint(f"{protocol}/127.0.0.1:0"),),
        sender=(f"{protocol}/127.0.0.1:0",),
        connect=(),
        receiver_credentials=shown["inv2"],
        sender_credentials=shown["inv1"],
        rules=rules,
    )


def compare_latencies(rounds: int, count: int, keys: Path) -> None:
    """Measure one way beside each other, and print medians over the rounds and their ratios."""
    arms: dict[str, Callable[[], list[float]]] = {
        "open links": lambda: latencies(count, None),
        "TLS, no access rules": lambda: latencies(count, keys, rules=False),
        "mutual TLS": lambda: latencies(count, keys),
    }
    times: dict[str, list[list[float]]] = {name: [] for name in arms}
    for i in range(rounds):
        for name in list(arms)[:: 1 if i % 2 == 0 else -1]:
            times[name].append(arms[name]())
        say(f"one way, round {i + 1} of {rounds}")
    print(f"{'one way (ms)':48}{'p50':>11}{'p99':>11}")
    cells = {
        name: [(median(took), quantiles(took, n=100)[98]) for took in per_round] for name, per_round in times.items()
    }
    for name, pairs in cells.items():
        print(f"{name:48}{1e3 * median(p for p, _ in pairs):11.3f}{1e3 * median(p for _, p in pairs):11.3f}")
    bare, *others = cells
    for other in others:
        for k, percentile in enumerate(("p50", "p99")):
            each = [its[k] / open_[k] for open_, its in zip(cells[bare], cells[other], strict=True)]
            print(f"{other}: ratio of {percentile} {median(each):.3f} ({min(each):.3f} to {max(each):.3f})")


def main() -> None:
    """Measure and print."""
    chosen = options(__doc__, rounds=5, end=4.0, messages=250)
    print(machine())
    with tempfile.TemporaryDirectory() as folder:
        keys = Path(folder) / "lab"
        make_site(keys)
        for number in range(1, 10):
            issue(keys, f"inv{number}")
        print("\nlock-step, nine agents in a star")
        ratios(
            {
                "open links": lambda: lock_step(Path(folder) / "logs", chosen.end, None),
                "mutual TLS": lambda: lock_step(Path(folder) / "logs", chosen.end, keys),
            },
            chosen.rounds,
        )
        print()
        compare_latencies(chosen.rounds, chosen.messages, keys)


if __name__ == "__main__":
    main()
