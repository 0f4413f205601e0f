"""The numbers that are asked for ("Done when" of issue 14), each met, missed or not measured."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from bench.peers.long_parts import LONG_RUNS, long_part
from bench.peers.quantity import Flatness, Quantity, spread
from bench.peers.stored import Parts


class Criterion(NamedTuple):
    """A number and its limit."""

    text: str
    number: Quantity | Flatness
    limit: float
    unit: str = ""
    at_least: bool = False
    """Whether the limit is the smallest number that passes."""

    def verdict(self, parts: Parts) -> str:
        """Return "met", "missed", or the reason why it is not measured."""
        if why := self.number.missing(parts):
            return why
        value = self.number.value(parts)
        return "met" if (value >= self.limit if self.at_least else value <= self.limit) else "missed"

    def away(self, parts: Parts) -> float:
        """Return the factor by which a number that is missed is away from its limit; infinite from 0."""
        value = self.number.value(parts)
        above, below = (self.limit, value) if self.at_least else (value, self.limit)
        return above / below if below > 0.0 else float("inf")

    def row(self, parts: Parts) -> tuple[str, ...]:
        """Return what, the limit, the number, its proportion to the limit, its rounds, the verdict, the load."""
        limit = f"{'at least' if self.at_least else 'at most'} {self.limit:g}{self.unit}"
        verdict = self.verdict(parts)
        if self.number.missing(parts):
            return self.text, limit, "", "", "", verdict, ""
        value, rounds = self.number.value(parts), self.number.rounds(parts)
        of_limit = f"{value / self.limit:.2f}"
        load = parts[self.number.part].load
        return self.text, limit, f"{value:.3g}{self.unit}", of_limit, spread(rounds), verdict, load


HEAD = ("what", "asked for", "measured", "of the limit", "rounds, least to largest", "", "load")
"""Of the table of all criteria."""

GRIDLABD = ("gridlabd.plant.steps",)
"""Without its start, which has a rest before t = 0 that only a comparison needs."""

PLANT = ("ours.plant.build", "ours.plant.steps")

FLAT_SIZES = (9, 30, 99, 300)
"""Numbers of agents over which the cost of a message is to be flat."""


def _criteria() -> tuple[Criterion, ...]:
    tick = "tick, a process for each agent"
    first = "first case with processes, from the start of the command"
    real_time = "s by the clock for a simulated second"
    flat = Flatness("links", tuple(f"inprocess.link.ring.{n}" for n in FLAT_SIZES))
    return (
        Criterion("plant: GridLAB-D / ours", Quantity("plant", GRIDLABD, PLANT), 100.0, at_least=True),
        Criterion("one case in process, warm", Quantity("case", ("ours.case.inprocess",)), 0.25, " s"),
        Criterion("sweep, once its workers run", Quantity("case", ("ours.sweep",)), 7.0, " runs/s", at_least=True),
        Criterion(
            "- with the start of the workers, 80 runs",
            Quantity("case", ("ours.sweep.whole",)),
            7.0,
            " runs/s",
            at_least=True,
        ),
        Criterion(f"{tick}: ours / bare Zenoh", Quantity("tick", ("ours.tick.9",), ("zenoh.tick.9",)), 1.6),
        *(
            Criterion(
                f"{tick}: HELICS {core}, empty / ours",
                Quantity("tick", (f"helics-{core}.tick.9",), ("ours.tick.9",)),
                3.0,
                at_least=True,
            )
            for core in ("zmq", "tcp")
        ),
        Criterion("tick, three agents a process", Quantity("tick", ("ours.tick.3",), scale=1e3), 1.2, " ms"),
        Criterion(
            "- as a part of bare Zenoh's tick, a process for each agent, which had 1.27 ms where 1.2 ms was aimed at",
            Quantity("tick", ("ours.tick.3",), ("zenoh.tick.9",)),
            round(1.2 / 1.27, 2),
        ),
        Criterion(f"{first} to its end", Quantity("command", ("ours.command.end",)), 1.5, " s"),
        Criterion("- to its last row, without the figures", Quantity("command", ("ours.command.last_row",)), 1.5, " s"),
        Criterion("- to its first row", Quantity("command", ("ours.command.first_row",)), 0.6, " s"),
        Criterion("each further case of a command, start to end", Quantity("tick", ("ours.case.9",)), 1.5, " s"),
        Criterion("`gridpeers --help`", Quantity("command", ("ours.help",)), 0.15, " s"),
        Criterion(f"999 agents in process, ring, T_c 100 ms: {real_time}", _by_the_clock(100, 999), 1.0, " s"),
        Criterion(f"306 agents in process, ring, T_c 20 ms: {real_time}", _by_the_clock(20, 306), 1.0, " s"),
        Criterion("a message in one process, ring, 9 to 300 agents: dearest size / cheapest", flat, 1.25),
        Criterion(
            f"100 agents in 8 processes, ring, T_c 100 ms, lock-step: {real_time}",
            Quantity("hosted", ("ours.hosted.100.per_second",)),
            1.0,
            " s",
        ),
        Criterion(
            "30 agent processes, ring, T_c 100 ms, wall-clock: steps in time",
            Quantity("hosted", ("ours.wall.30.in_time",)),
            99.0,
            " %",
            at_least=True,
        ),
        *_long_runs(),
    )


def _by_the_clock(T_c_ms: int, agents: int) -> Quantity:
    return Quantity("scale", (f"scale.{T_c_ms}.{agents}.by_the_clock",))


def _long_runs() -> Iterator[Criterion]:
    for run in LONG_RUNS:
        part = long_part(run)
        yield Criterion(f"long run `{run}`: growth of memory", Quantity(part, (f"{run}.growth",)), 5.0, " %")
        text = "- time per tick, last quarter : first"
        yield Criterion(text, Quantity(part, (f"{run}.late_ticks",)), 1.25)


CRITERIA = _criteria()
