"""The rows of the page that no criterion has: ours beside each rival, ours alone, other sizes, long runs, machines."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from bench.peers.criteria import GRIDLABD, PLANT
from bench.peers.long_parts import LONG_RUNS, long_part
from bench.peers.quantity import Quantity, missing, seconds_in_words, spread
from bench.peers.stored import Parts

RIVALS = ("gridlabd", "helics", "pyzmq")
"""Distributions whose versions the page has; the JSON has more."""

SCALE = ((9, 100), (27, 100), (99, 100), (306, 100), (999, 100), (306, 20))
"""Numbers of agents, and T_c (ms), of the part `scale`."""

SCALE_HEAD = (
    *("agents, ring", "read and build (s)", "plant", "agents", "together", "by the clock", "rounds of it"),
    *("a message (µs)", "memory (MB)"),
)

LONG_HEAD = ("run", "memory at the end", "growth, at most", "time per tick, last quarter : first", "files")

COMPARISON_HEAD = ("what", "the rival's", "ours", "rival's / ours", "rounds, least to largest")


class _Beside(NamedTuple):
    """Ours beside a rival's."""

    text: str
    part: str
    theirs: tuple[str, ...]
    ours: tuple[str, ...]


def _rivals() -> tuple[_Beside, ...]:
    tick, three, own = "a tick, a process for each agent", "a tick, three agents a process", ("ours.tick.9",)
    hosted = "a tick, 100 agents on a ring in 8 processes"
    return (
        _Beside("plant, 7 s: GridLAB-D's steps, our build and steps", "plant", GRIDLABD, PLANT),
        _Beside("- the steps alone", "plant", GRIDLABD, PLANT[1:]),
        _Beside(f"{tick}: HELICS zmq, empty federates", "tick", ("helics-zmq.tick.9",), own),
        _Beside(f"{tick}: HELICS tcp, empty federates", "tick", ("helics-tcp.tick.9",), own),
        _Beside(f"{tick}: ZeroMQ ipc, empty", "tick", ("zeromq.tick.9",), own),
        _Beside(f"{tick}: bare Zenoh, empty", "tick", ("zenoh.tick.9",), own),
        _Beside(f"{tick}: bare Zenoh, empty, the hub relays", "tick", ("zenoh-star.tick.9",), own),
        _Beside(f"{three}: bare Zenoh, empty", "tick", ("zenoh.tick.3",), ("ours.tick.3",)),
        _Beside(f"{three}: bare Zenoh, empty, the hub relays", "tick", ("zenoh-star.tick.3",), ("ours.tick.3",)),
        _Beside(f"{hosted}: bare Zenoh, empty", "hosted", ("zenoh.hosted.100",), ("ours.hosted.100.tick",)),
    )


ALONE = (
    ("one case in process, warm, processor time", Quantity("case", ("ours.case.inprocess",))),
    (
        "first case with processes, from the start of the command to its first row",
        Quantity("command", ("ours.command.first_row",)),
    ),
    ("- to its last row", Quantity("command", ("ours.command.last_row",))),
    ("- to its end, with tables and figures", Quantity("command", ("ours.command.end",))),
    ("each further case of a command, start to end", Quantity("tick", ("ours.case.9",))),
    ("- of it until the first row", Quantity("tick", ("ours.first_row.9",))),
    ("each further case, three agents a process, start to end", Quantity("tick", ("ours.case.3",))),
    ("`gridpeers --help`", Quantity("command", ("ours.help",))),
    (
        "a simulated second of 100 agents in 8 processes, ring, T_c 100 ms, lock-step",
        Quantity("hosted", ("ours.hosted.100.per_second",)),
    ),
    ("- of 300 agents in 8 processes", Quantity("hosted", ("ours.hosted.300.per_second",))),
    ("- the start of 300 agents, until the first row", Quantity("hosted", ("ours.hosted.300.start",))),
)
"""Times (s) that no rival has."""


def comparison(parts: Parts) -> Iterator[tuple[str, ...]]:
    """Yield the rows of the table: ours and each rival's, with the ratio, or why it is not there."""
    for row in _rivals():
        theirs, ours = Quantity(row.part, row.theirs), Quantity(row.part, row.ours)
        ratio = Quantity(row.part, row.theirs, row.ours)
        if why := ratio.missing(parts):
            yield row.text, *(_time(each, parts) for each in (theirs, ours)), "", why
            continue
        yield (
            row.text,
            _time(theirs, parts),
            _time(ours, parts),
            f"{ratio.value(parts):.3g}",
            spread(ratio.rounds(parts)),
        )


def alone(parts: Parts) -> Iterator[tuple[str, str, str]]:
    """Yield the rows that no rival has: the median, and its rounds or why it is not there."""
    for text, quantity in ALONE:
        yield text, _time(quantity, parts), quantity.missing(parts) or spread(quantity.rounds(parts), " s")
    for text, name in (
        ("a sweep on all cores, once its workers run", "ours.sweep"),
        ("- with their start, 80 runs", "ours.sweep.whole"),
    ):
        rate = Quantity("case", (name,))
        if why := rate.missing(parts):
            yield text, "", why
        else:
            yield text, f"{rate.value(parts):.3g} runs/s", spread(rate.rounds(parts))


def shares(parts: Parts) -> Iterator[tuple[str, str, str]]:
    """Yield the parts of a case in one process, the largest first: milliseconds and percent."""
    if "case" not in parts:
        return
    found = {
        name.removeprefix("share."): parts["case"].median(name)
        for name in parts["case"].values
        if name.startswith("share.") and not name.endswith("all ticks")
    }
    for part, seconds in sorted(found.items(), key=lambda item: -item[1]):
        yield part, f"{1e3 * seconds:.0f}", f"{100 * seconds / sum(found.values()):.0f}"


def scale(parts: Parts) -> Iterator[tuple[str, ...]]:
    """Yield a row for each number of agents in one process, or why it is not there."""
    for agents, T_c_ms in SCALE:
        prefix = f"scale.{T_c_ms}.{agents}."
        text = f"{agents}" if T_c_ms == 100 else f"{agents}, T_c {T_c_ms} ms"
        if why := missing(parts, "scale", (f"{prefix}by_the_clock",)):
            yield text, why, *[""] * (len(SCALE_HEAD) - 2)
            continue
        of = {name: parts["scale"].median(prefix + name) for name in _SCALE_VALUES}
        yield (
            text,
            f"{of['read_s'] + of['build_s']:.2g}",
            *(f"{of[name]:.2g}" for name in ("plant_per_s", "agents_per_s", "of_real_time", "by_the_clock")),
            spread(parts["scale"].values[f"{prefix}by_the_clock"]),
            f"{of['us_per_message']:.3g}",
            f"{of['memory_MB']:.0f}",
        )


_SCALE_VALUES = (
    *("read_s", "build_s", "plant_per_s", "agents_per_s", "of_real_time", "by_the_clock", "us_per_message"),
    "memory_MB",
)


def long_runs(parts: Parts) -> Iterator[tuple[str, ...]]:
    """Yield a row for each long run, or why it is not there."""
    for run, text in LONG_RUNS.items():
        part = long_part(run)
        if why := missing(parts, part, (f"{run}.growth", f"{run}.late_ticks")):
            yield f"`{run}`: {text}", why, *[""] * (len(LONG_HEAD) - 2)
            continue
        of = {name.removeprefix(f"{run}."): parts[part].median(name) for name in parts[part].values}
        memory = {name.removeprefix("memory."): x for name, x in of.items() if name.startswith("memory.")}
        files = {name.removeprefix("file."): x for name, x in of.items() if name.startswith("file.")}
        yield (
            f"`{run}`: {text}, {of['seconds']:.0f} s",
            ", ".join(f"{name} {megabytes:.0f} MB" for name, megabytes in memory.items()),
            f"{of['growth']:.1f} %",
            f"{of['late_ticks']:.2f}",
            ", ".join(f"{name} {megabytes:.1f} MB" for name, megabytes in files.items()),
        )


def machines(parts: Parts) -> Iterator[str]:
    """Yield a line on the date, machine, load and versions of each part, and one on each measure that is left out."""
    for name, part in parts.items():
        versions = ", ".join(f"{package} {part.versions[package]}" for package in RIVALS if package in part.versions)
        yield (
            f"- `{name}`: {part.began}, commit {part.commit}, {part.seconds:.0f} s; {part.machine}; load {part.load} "
            f"of the processors; {versions}"
        )
        yield from (f"  - left out: {measure}: {why}" for measure, why in part.left_out.items())


def _time(quantity: Quantity, parts: Parts) -> str:
    return "" if quantity.missing(parts) else seconds_in_words(quantity.value(parts))
