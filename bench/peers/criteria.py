"""The numbers that issue 14 asks for, each met or missed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import isnan
from typing import NamedTuple

from bench.peers.measured import PartRun

Parts = Mapping[str, PartRun]


class Criterion(NamedTuple):
    """A number and its limit."""

    text: str
    value: Callable[[Parts], float]
    """The number; nan where a measurement is missing."""
    limit: float
    unit: str = ""
    at_least: bool = False
    """Whether the limit is the smallest number that passes."""

    def verdict(self, parts: Parts) -> tuple[str, str, str]:
        """Return the number, the limit, and "met", "missed" or "not measured"."""
        value = self.value(parts)
        limit = f"{'>=' if self.at_least else '<='} {self.limit:g}{self.unit}"
        if isnan(value):
            return "", limit, "not measured"
        met = value >= self.limit if self.at_least else value <= self.limit
        return f"{value:.3g}{self.unit}", limit, "met" if met else "missed"


def value(parts: Parts, part: str, *names: str) -> float:
    """Return the sum of the medians of some values of a part; nan where one is missing."""
    return sum(parts[part].median(name) for name in names) if part in parts else float("nan")


def ratio(parts: Parts, part: str, above: tuple[str, ...], below: tuple[str, ...]) -> float:
    """Return the ratio of two sums of medians of one part."""
    under = value(parts, part, *below)
    return value(parts, part, *above) / under if under else float("nan")


def spread(parts: Parts, graph: str, start: int) -> float:
    """Return by how much (%) the largest cost of a link is beyond that with `start` agents; nan without a second."""
    if "links" not in parts:
        return float("nan")
    prefix = f"inprocess.link.{graph}."
    costs = {
        int(name.removeprefix(prefix)): parts["links"].median(name)
        for name in parts["links"].values
        if name.startswith(prefix)
    }
    if start not in costs or len(costs) < 2:
        return float("nan")
    return 100.0 * (max(costs.values()) / costs[start] - 1.0)


GRIDLABD = ("gridlabd.plant.steps",)
"""Without its start, which has a rest before t = 0 that only a comparison needs."""

PLANT = ("ours.plant.build", "ours.plant.steps")

CRITERIA = (
    Criterion("plant: GridLAB-D / ours", lambda parts: ratio(parts, "plant", GRIDLABD, PLANT), 100.0, at_least=True),
    Criterion("one case in process, warm", lambda parts: value(parts, "case", "ours.case.inprocess"), 0.25, " s"),
    Criterion("sweep, runs per second", lambda parts: value(parts, "case", "ours.sweep"), 7.0, at_least=True),
    Criterion(
        "tick, a process for each agent: ours / bare Zenoh",
        lambda parts: ratio(parts, "tick", ("ours.tick.9",), ("zenoh.tick.9",)),
        1.6,
    ),
    Criterion(
        "tick: HELICS zmq, empty / ours",
        lambda parts: ratio(parts, "tick", ("helics-zmq.tick.9",), ("ours.tick.9",)),
        3.0,
        at_least=True,
    ),
    Criterion(
        "tick: HELICS tcp, empty / ours",
        lambda parts: ratio(parts, "tick", ("helics-tcp.tick.9",), ("ours.tick.9",)),
        3.0,
        at_least=True,
    ),
    Criterion("tick, three agents a process", lambda parts: 1e3 * value(parts, "tick", "ours.tick.3"), 1.2, " ms"),
    Criterion(
        "one case with processes but the first, start to end",
        lambda parts: value(parts, "tick", "ours.case.9"),
        1.5,
        " s",
    ),
    Criterion("start: until the first row", lambda parts: value(parts, "tick", "ours.first_row.9"), 0.6, " s"),
    Criterion("gridpeers --help", lambda parts: value(parts, "case", "ours.help"), 0.15, " s"),
    Criterion("cost of a link, ring, 9 to 300 agents, growth", lambda parts: spread(parts, "ring", 9), 25.0, " %"),
)
