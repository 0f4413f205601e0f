"""The long runs of `bench.long_runs`, each a part of its own among the stored measurements."""

from __future__ import annotations

LONG_RUNS = {
    "inprocess": "in one process",
    "links": "in one process, a delay on every link",
    "processes": "a process for each agent",
    "live": "`gridpeers up`, by the clock",
}


def long_part(run: str) -> str:
    """Return the name under which a long run is stored: each is a part of its own."""
    return f"long-{run}"
