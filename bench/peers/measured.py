"""Measurements of one part of the bench: rounds in which all take turns, the machine's load, versions, and medians."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from math import isfinite
from statistics import median
from time import monotonic
from typing import NamedTuple

import msgspec

from bench.harness import machine
from bench.peers import machine_use
from bench.peers.failure import reason


class Measure(NamedTuple):
    """One thing that is measured, or several at once."""

    name: str
    """For progress, and where it is left out."""
    run: Callable[[], Mapping[str, float]]
    """Measure once, by the names of the values."""
    needs: str = ""
    """Distribution of the rival; without it the measure is left out and named."""
    rounds: int | None = None
    """Rounds in which it takes part; all when left out."""
    values: tuple[str, ...] = ()
    """Names of the values that it gives, as far as rows of the page show them; they tell the reason if it fails."""

    def rounds_of(self, rounds: int) -> int:
        """Return in how many of so many rounds it takes part."""
        return rounds if self.rounds is None else min(rounds, self.rounds)


class PartRun(msgspec.Struct, kw_only=True):
    """The measurements of one part of the bench."""

    began: str
    commit: str
    """Of this repository; "+" behind it marks changes that were not committed."""
    machine: str
    """Processor, cores, load before, system."""
    versions: dict[str, str]
    loads: list[float]
    """Load (1 min) before, and after each round."""
    others: float = 0.0
    """Part of the machine's processor time that other programs took meanwhile."""
    seconds: float = 0.0
    """Duration."""
    values: dict[str, list[float]] = {}
    """Values of each round, by name."""
    left_out: dict[str, str] = {}
    """Measures that could not be done, and the reason."""
    missing: dict[str, str] = {}
    """Values that a row would show and that are not there, and the reason."""
    took: dict[str, float] = {}
    """Median duration (s) of each measure: the usual time for the next run."""
    failed: bool = False
    """Whether a measure failed, not only for want of a rival's package."""

    def median(self, name: str) -> float:
        """Return the median of a value over the rounds; nan if it was not measured."""
        return median(self.values[name]) if self.values.get(name) else float("nan")

    @property
    def load(self) -> str:
        """The load before and at most during it, and what other programs took."""
        most = max(self.loads[1:], default=self.loads[0])
        return f"{self.loads[0]:.1f} to {most:.1f}, others {100.0 * self.others:.0f} %"

    def leave_out(self, measure: Measure, why: str, *, failed: bool = True) -> None:
        """Note that a measure could not be done."""
        self.left_out[measure.name] = why
        self.missing |= {name: f"{measure.name}: {why}" for name in measure.values if name not in self.values}
        self.failed = self.failed or failed


Tell = Callable[[str, Measure], None]
"""Takes the round, in words, and the measure that begins."""


def measure_in_turns(
    measures: Callable[[], Sequence[Measure]], rounds: int, tell: Tell = lambda text, measure: None
) -> PartRun:
    """Measure all, round by round, each round in another order.

    What fails is left out from then on, with its reason; the others go on.

    Parameters
    ----------
    measures
        Makes the measures; what they share may take a while to make, or fail, too.
    rounds
        How often each is measured, unless it says otherwise.
    tell
        Is called before each measurement.
    """
    part = PartRun(
        began=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        commit=machine_use.commit(),
        machine=machine(),
        versions=machine_use.versions(),
        loads=[machine_use.load()],
    )
    use = machine_use.MachineUse()
    took: dict[str, list[float]] = {}
    try:
        found = list(measures())
    except Exception as error:  # whatever it is, the other parts are measured
        part.left_out["all of it"], part.failed = reason(error), True
        return part
    for measure in found:
        if measure.needs and not machine_use.version(measure.needs):
            why = f"{measure.needs} is not installed: pip install 'gridpeers[bench]'"
            part.leave_out(measure, why, failed=False)
    for i in range(rounds):
        k = i % max(len(found), 1)
        for measure in (*found[k:], *found[:k]):
            if measure.name in part.left_out or i >= measure.rounds_of(rounds):
                continue
            tell(f"round {i + 1} of {rounds}", measure)
            began = monotonic()
            try:
                for name, value in measure.run().items():
                    if not isfinite(value):
                        raise RuntimeError(f"{name}: a finite number was to be measured, not {value}")
                    part.values.setdefault(name, []).append(value)
            except Exception as error:  # the same: a rival may raise anything
                part.leave_out(measure, reason(error))
            took.setdefault(measure.name, []).append(monotonic() - began)
        part.loads.append(machine_use.load())
    part.took = {name: round(median(seconds), 2) for name, seconds in took.items()}
    part.seconds, part.others = round(use.seconds, 1), round(use.others, 3)
    return part
