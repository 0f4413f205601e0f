"""Measurements of one part of the bench, in rounds in which all take turns, and their tables as Markdown."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from math import isfinite
from typing import NamedTuple

import msgspec
import pandas as pd

from bench.harness import MachineUse, commit, machine, markdown, reason, version


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
        began=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),  # noqa: TID251
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


PLANT = ("ours.plant.build", "ours.plant.steps")

RATIOS = (
    ("plant: GridLAB-D's steps, our build and steps", "plant", ("gridlabd.plant.steps",), PLANT),
    ("- the steps alone", "plant", ("gridlabd.plant.steps",), PLANT[1:]),
    *(
        (f"a tick, {text}", "tick", (f"{rival}.tick.{agents}",), (f"ours.tick.{agents}",))
        for text, rival, agents in (
            ("a process for each agent: HELICS zmq, empty federates", "helics-zmq", 9),
            ("a process for each agent: HELICS tcp, empty federates", "helics-tcp", 9),
            ("a process for each agent: ZeroMQ ipc, empty", "zeromq", 9),
            ("a process for each agent: bare Zenoh, empty", "zenoh", 9),
            ("a process for each agent: bare Zenoh, empty, the hub relays", "zenoh-star", 9),
            ("three agents a process: bare Zenoh, empty", "zenoh", 3),
            ("three agents a process: bare Zenoh, empty, the hub relays", "zenoh-star", 3),
        )
    ),
)
"""Rows of a rival beside ours: text, part, and the values whose sum is the rival's time, and ours."""


def tables_text(parts: Mapping[str, PartRun]) -> str:
    """Return the tables; a ratio whose value is missing has no row, and what was left out stands at the end."""
    values = pd.DataFrame(
        [
            (name, value, _unit(value), *_spread(pd.Series(rounds)))
            for name, part in parts.items()
            for value, rounds in part.values.items()
        ],
        columns=["part", "value", "unit", *SPREAD],
    )
    ratios = pd.DataFrame(
        [(text, *row) for text, part, theirs, ours in RATIOS if (row := _ratio(parts, part, theirs, ours))],
        columns=["what", "the rival's (ms)", "ours (ms)", *(f"rival's / ours, {name}" for name in SPREAD)],
    )
    shown = [markdown(table.columns, table.to_numpy().tolist()) for table in (ratios, values) if len(table)]
    return "\n\n".join([*shown, "\n".join(machines(parts))])


SPREAD = ("median", "least", "largest", "rounds")


def _spread(rounds: pd.Series[float]) -> tuple[float, float, float, int]:
    return rounds.median(), rounds.min(), rounds.max(), len(rounds)


def _unit(value: str) -> str:
    return {"us_per_message": "us", "memory_MB": "MB", "sweep": "runs/s", "whole": "runs/s"}.get(
        value.rpartition(".")[2], "s"
    )


def _ratio(
    parts: Mapping[str, PartRun], part: str, theirs: tuple[str, ...], ours: tuple[str, ...]
) -> tuple[float, ...] | None:
    """Return medians (ms) and the ratio, whose rounds are those in which both took turns; None if one is missing."""
    values = parts[part].values if part in parts else {}
    if not values.keys() >= {*theirs, *ours}:
        return None
    frame = pd.DataFrame({name: pd.Series(values[name]) for name in {*theirs, *ours}})
    them, us = frame[list(theirs)].sum(axis=1), frame[list(ours)].sum(axis=1)
    return 1e3 * them.median(), 1e3 * us.median(), *_spread((them / us).dropna())


def machines(parts: Mapping[str, PartRun]) -> Iterator[str]:
    """Yield a line on the date, machine and load of each part, and one on each measure that is left out."""
    for name, part in parts.items():
        yield (
            f"- `{name}`: {part.began}, commit {part.commit}, {part.seconds:.0f} s; {part.machine}; load up to "
            f"{max(part.loads):.1f}, others {100.0 * part.others:.0f} % of the processors"
        )
        yield from (f"  - left out: {measure}: {why}" for measure, why in part.left_out.items())
