"""Measurements that nobody made, for tests of the page and of its rows."""

from bench.peers.measured import PartRun


def part_of(**values: list[float]) -> PartRun:
    """Return the measurements of a part; "__" in a name is a dot."""
    return PartRun(
        began="2026-01-01 00:00 UTC",
        commit="abc",
        machine="a machine",
        versions={"pyzmq": "27"},
        loads=[0.1, 0.2],
        seconds=12.0,
        values={name.replace("__", "."): found for name, found in values.items()},
    )
