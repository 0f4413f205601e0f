"""Measurements of one part of the bench: rounds in which all take turns, the machine's load, and versions."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from math import isfinite
from typing import NamedTuple

import msgspec

from bench.harness import MachineUse, commit, machine, reason, version


class Measure(NamedTuple):
    """One thing that is measured, or several at once."""

    name: str
    """For progress, and where it is left out."""
    run: Callable[[], Mapping[str, float]]
    """Measure once, by the names of the values."""
    needs: str = ""
    """Distribution of the rival; without it the measure is left out and named."""


class PartRun(msgspec.Struct, kw_only=True):
    """The measurements of one part of the bench."""

    began: str
    commit: str
    """Of this repository; "+" behind it marks changes that were not committed."""
    machine: str
    """Processor, cores, load before, system, versions."""
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
    failed: bool = False
    """Whether a measure failed, not only for want of a rival's package."""


def measure_in_turns(
    measures: Callable[[], Sequence[Measure]], rounds: int, tell: Callable[[str], None] = lambda text: None
) -> PartRun:
    """Measure all, round by round, each round in another order, and tell what begins.

    What fails is left out from then on, with its reason; the others go on. What the measures share may take a while to
    make, or fail, too.
    """
    part = PartRun(
        began=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        commit=commit(),
        machine=machine(),
        loads=[os.getloadavg()[0]],
    )
    use = MachineUse()
    try:
        found = list(measures())
    except Exception as error:  # whatever it is, the other parts are measured
        part.left_out["all of it"], part.failed = reason(error), True
        return part
    for each in found:
        if each.needs and not version(each.needs):
            part.left_out[each.name] = f"{each.needs} is not installed: pip install 'gridpeers[bench]'"
    for i in range(rounds):
        k = i % max(len(found), 1)
        for measure in (*found[k:], *found[:k]):
            if measure.name in part.left_out:
                continue
            tell(f"round {i + 1} of {rounds}, {measure.name}")
            try:
                for name, value in measure.run().items():
                    if not isfinite(value):
                        raise RuntimeError(f"{name}: a finite number was to be measured, not {value}")
                    part.values.setdefault(name, []).append(value)
            except Exception as error:  # the same: a rival may raise anything
                part.left_out[measure.name], part.failed = reason(error), True
        part.loads.append(os.getloadavg()[0])
    part.seconds, part.others = round(use.seconds, 1), round(use.others, 3)
    return part
