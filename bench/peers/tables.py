"""The tables of the measurements, as Markdown: ours beside each rival's, every value, and the machine."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import pandas as pd

from bench.harness import markdown
from bench.peers.measured import PartRun

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
