"""The tables of the measurements, as Markdown: ours beside each rival's, every value, and the machine."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import pandas as pd

from bench.harness import markdown
from bench.peers.measured import PartRun

PLANT = ("ours.plant.build", "ours.plant.steps")


class Ratio(NamedTuple):
    """A rival's time beside ours; each is a sum of values of one part."""

    text: str
    part: str
    theirs: tuple[str, ...]
    ours: tuple[str, ...]


def _tick(kind: str, what: str, rival: str, agents: int) -> Ratio:
    return Ratio(f"a tick, {kind}: {what}", "tick", (f"{rival}.tick.{agents}",), (f"ours.tick.{agents}",))


RATIOS = (
    Ratio("plant: GridLAB-D's steps, our build and steps", "plant", ("gridlabd.plant.steps",), PLANT),
    Ratio("- the steps alone", "plant", ("gridlabd.plant.steps",), PLANT[1:]),
    *(
        _tick("a process for each agent", what, rival, 9)
        for what, rival in (
            ("HELICS zmq, empty federates", "helics-zmq"),
            ("HELICS tcp, empty federates", "helics-tcp"),
            ("ZeroMQ ipc, empty", "zeromq"),
            ("bare Zenoh, empty", "zenoh"),
            ("bare Zenoh, empty, the hub relays", "zenoh-star"),
        )
    ),
    _tick("three agents a process", "bare Zenoh, empty", "zenoh", 3),
    _tick("three agents a process", "bare Zenoh, empty, the hub relays", "zenoh-star", 3),
)


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
        [(ratio.text, *row) for ratio in RATIOS if (row := _ratio(ratio, parts))],
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


def _ratio(ratio: Ratio, parts: Mapping[str, PartRun]) -> tuple[float, ...] | None:
    """Return medians (ms) and the ratio, whose rounds are those in which both took turns; None if one is missing."""
    values = parts[ratio.part].values if ratio.part in parts else {}
    if not all(name in values for name in (*ratio.theirs, *ratio.ours)):
        return None
    frame = pd.DataFrame({name: pd.Series(values[name]) for name in {*ratio.theirs, *ratio.ours}})
    theirs, ours = frame[list(ratio.theirs)].sum(axis=1), frame[list(ratio.ours)].sum(axis=1)
    return 1e3 * theirs.median(), 1e3 * ours.median(), *_spread((theirs / ours).dropna())


def machines(parts: Mapping[str, PartRun]) -> Iterator[str]:
    """Yield a line on the date, machine and load of each part, and one on each measure that is left out."""
    for name, part in parts.items():
        yield (
            f"- `{name}`: {part.began}, commit {part.commit}, {part.seconds:.0f} s; {part.machine}; load up to "
            f"{max(part.loads):.1f}, others {100.0 * part.others:.0f} % of the processors; "
            + ", ".join(f"{package} {found}" for package, found in part.versions.items())
        )
        yield from (f"  - left out: {measure}: {why}" for measure, why in part.left_out.items())
