"""The page docs/performance.md with its figures and its JSON, from the measurements of the bench alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
import msgspec
from matplotlib.figure import Figure

from bench.peers.criteria import CRITERIA, GRIDLABD, PLANT, Parts, value
from bench.peers.measured import PartRun
from bench.peers.our_scale import links
from gridpeers.figures import PAGE, save

PAGE_FILE, DATA_FILE, FIGURES = "performance.md", "performance.json", "images/performance"

INTRODUCTION = """# Performance

For everybody who asks what gridpeers costs, beside what, and how far it is from the limit. One command measures all of
it in one run and writes this page, its figures and [performance.json](performance.json):

```sh
pip install -e '.[bench]'
python -m bench.peers --write docs     # a quarter of an hour; or some parts: {names}
```

Rivals take turns, round by round, and a number is the median of the rounds. Ratios hold from machine to machine better
than seconds do. Times in one process are processor time; with processes they are by the clock, so that other programs
count: the load is stated. A rival whose package is missing is left out and named.

The case: the islanding experiment, case IV, nine inverters with agents on the 123-node feeder, full graph, 7 s
simulated, T_c 20 ms, h 2 ms. A tick is one control period of the lock-step: 9 measurements, 72 states to neighbours, 9
to the plant. All meshes have the processes and the messages of ours, in number and size, and compute nothing; those of
HELICS ask for time once a tick, so that its federates see values one tick late, which is generous to HELICS. The
session of our plant relays all messages ([protocol.md](protocol.md#one-link-each)). So does the hub of bare Zenoh where
a row says so; elsewhere bare Zenoh has a link for each pair of processes.
"""

NOTES = """## Where the limit is

- **Plant.** The steps are one compiled loop; the limit is the solution with sparse factors, one iteration each, and the
  controllers; the build is limited by one sparse factorisation. GridLAB-D solves the whole network by Newton's method
  in every step.
- **Tick.** Bare Zenoh is the limit of any lock-step over Zenoh: its system calls and wakes, once a message and link. A
  relay writes what has come for an agent in one go, so that it saves most of them; agents that share a process save the
  rest. ZeroMQ over Unix sockets shows what a transport without discovery, routing and TCP costs.
- **One process.** There is no transport: each message costs its way through the same nodes that processes have
  (decode, checks, the law's sum), so that the cost grows with links, not with pairs of agents.
- **Start.** Python's imports, then discovery: each process opens a session and meets those it hears.
"""

QUIET = 0.1
"""Part of the processors that other programs may take on a machine that counts as idle."""

RIVALS = ("gridlabd", "helics", "pyzmq")
"""Distributions whose versions the page has; the JSON has more."""

SCALE = """## From nine agents to 999 in one process

`python -m bench.scale`: joined copies of the feeder, islanded as one, T_c 0.1 s, h 2 ms; seconds of processor time a
simulated second, the least of three runs, on two cores with load 1.5 to 4. A message is a state to a neighbour, or one
from or to the plant.

| agents, ring | read and build (s) | plant | agents | together | a message (us) | memory (MB) |
| --- | --- | --- | --- | --- | --- | --- |
| 9 | 0.05 | 0.009 | 0.005 | 0.014 | 14.5 | 214 |
| 27 | 0.11 | 0.027 | 0.018 | 0.045 | 17.1 | 234 |
| 99 | 0.41 | 0.090 | 0.063 | 0.15 | 15.9 | 267 |
| 306 | 1.0 | 0.28 | 0.20 | 0.49 | 16.6 | 306 |
| 999 | 3.9 | 0.83 | 0.63 | 1.46 | 15.8 | 455 |
| 306, T_c 20 ms | 1.1 | 0.42 | 0.73 | 1.15 | 11.9 | 301 |

![Cost of a simulated second, and of a message, against the number of agents](images/performance/scale.svg)

Everything grows with the number of agents, and a message costs the same within 18 %. Not so in another run of the same
evening, with more load: there it took 11 us with 9 agents, 14 with 306 and 18 with 999, whose objects do not fit the
cache. **999 agents on a ring are not faster than real time**, nor 306 at 20 ms. What bounds 999, of a network solution
of 0.5 to 0.65 ms (1000 a second): solving with the factors 0.19 to 0.25 ms (57 000 entries, one iteration a solution),
controllers 0.13, branch currents and voltages 0.06, first guess and its history 0.03; the rest waits for the memory.
The agents need 63 us each a tick, in Python. Where the copies are islands of their own (`--apart 1`) the plant steps
them on both cores: 1.30 s by the clock instead of 1.53 s of processor time.
"""

LONG_RUNS = """## Long runs

`python -m bench.long_runs` watches the anonymous memory of every process, the size of the files and the time per tick;
`links` has a delay on every link, and so a row in links.csv for each message. Islanding, nine agents, on a shared
machine of two cores; growth is from a fifth of the run to its end:

| run | memory at the end | growth, at most | files |
| --- | --- | --- | --- |
| `inprocess`, 600 s simulated | 107 MB | 0.1 % | history.csv 58 MB |
| `processes`, 600 s simulated | plant 97 MB, command 36 MB, an agent 14 MB | 2.3 % | history.csv 58 MB |
| `links`, 200 s simulated in one process | 107 MB | 0.8 % | history.csv 19 MB, links.csv 24 MB |
| `live`, 10 min by the clock | command 78 MB, plant 232 MB, an agent 15 MB | 2 % | history.csv, as above |

Time per tick (processor time) of the last quarter is that of the
first within what other programs do to it: 0.7 to 1.04 times. `gridpeers check` and `gridpeers run` tell the size of a
long run's files before it starts ([results.md](results.md)).
"""

COLOURS = {"ours": "#0072b2", "zenoh": "#7a7a7a", "zeromq": "#009e73", "full": "#0072b2", "ring": "#d55e00"}
NAMES = {"ours": "gridpeers", "zenoh": "bare Zenoh", "zeromq": "ZeroMQ ipc"}


def write_page(parts: Parts, folder: Path, names: Mapping[str, str]) -> Path:
    """Write page, figures and JSON into a folder, and return the page."""
    folder.mkdir(parents=True, exist_ok=True)
    figures = []
    for name, title, draw in (
        ("agents", "Cost of a tick against the number of agents, a process each", _draw_agents),
        ("links", "Cost of a message in one process", _draw_links),
    ):
        if name in parts and parts[name].values:
            with mpl.rc_context(PAGE):
                save(draw(parts[name]), folder / FIGURES, name, formats=("svg",))
            figures.append(f"## {title}\n\n![{title}]({FIGURES}/{name}.svg)")
    (folder / DATA_FILE).write_bytes(msgspec.json.format(msgspec.json.encode(parts), indent=1) + b"\n")
    sections = [
        INTRODUCTION.format(names=", ".join(f"`{name}`" for name in names)).rstrip("\n"),
        *_warning(parts),
        "## Ours beside its peers\n\n" + _table(("what", "the rival's", "ours", "ratio"), comparison(parts)),
        "## What was asked for\n\n" + _table(("what", "measured", "asked for", ""), checks(parts)),
        *figures,
    ]
    if shares := list(_shares(parts)):
        sections.append("## Parts of a case in one process\n\n" + _table(("part", "ms", "%"), shares))
    sections += [
        NOTES.rstrip("\n"),
        SCALE.rstrip("\n"),
        LONG_RUNS.rstrip("\n"),
        "## The machine\n\n" + "\n".join(machines(parts)),
    ]
    page = folder / PAGE_FILE
    page.write_text("\n\n".join(sections) + "\n", encoding="utf-8")
    return page


def _warning(parts: Parts) -> Iterator[str]:
    """Yield a paragraph where other programs had a share of the machine that spoils the numbers."""
    busy = max((part.others for part in parts.values()), default=0.0)
    if busy > QUIET:
        yield (
            f"**These numbers are of a busy machine**: other programs took up to {100 * busy:.0f} % of its processors. "
            "They show the order of things; run the command on an idle machine for the verdicts."
        )


def read_parts(folder: Path) -> dict[str, PartRun]:
    """Return the measurements that a page stands on; none where there is no page."""
    file = folder / DATA_FILE
    return msgspec.json.decode(file.read_bytes(), type=dict[str, PartRun]) if file.exists() else {}


def comparison(parts: Parts) -> Iterator[tuple[str, ...]]:
    """Yield the rows of the table: ours and each rival, with the ratio."""
    tick = "a tick, a process for each agent"
    rows: list[tuple[str, str, tuple[str, ...], tuple[str, ...]]] = [
        ("plant, 7 s: GridLAB-D's steps, our build and steps", "plant", GRIDLABD, PLANT),
        ("- the steps alone", "plant", GRIDLABD, PLANT[1:]),
        (f"{tick}: HELICS zmq, empty federates", "tick", ("helics-zmq.tick.9",), ("ours.tick.9",)),
        (f"{tick}: HELICS tcp, empty federates", "tick", ("helics-tcp.tick.9",), ("ours.tick.9",)),
        (f"{tick}: bare Zenoh, empty", "tick", ("zenoh.tick.9",), ("ours.tick.9",)),
        (f"{tick}: bare Zenoh, empty, the hub relays", "tick", ("zenoh-star.tick.9",), ("ours.tick.9",)),
        (f"{tick}: ZeroMQ ipc, empty", "tick", ("zeromq.tick.9",), ("ours.tick.9",)),
        ("a tick, three agents a process: bare Zenoh, empty", "tick", ("zenoh.tick.3",), ("ours.tick.3",)),
        ("- the hub relays", "tick", ("zenoh-star.tick.3",), ("ours.tick.3",)),
    ]
    for text, part, theirs, ours in rows:
        them, us = value(parts, part, *theirs), value(parts, part, *ours)
        if us == us and us:
            yield text, _time(them), _time(us), f"{them / us:.3g}" if them == them else ""
    alone = [
        ("one case in process, warm, processor time", "case", "ours.case.inprocess"),
        ("the first case with processes, start to end", "tick", "ours.first_case.9"),
        ("each further case of a command, start to end", "tick", "ours.case.9"),
        ("- of it until the first row", "tick", "ours.first_row.9"),
        ("one case, three agents a process, start to end", "tick", "ours.case.3"),
        ("`gridpeers --help`", "case", "ours.help"),
    ]
    for text, part, name in alone:
        if (us := value(parts, part, name)) == us:
            yield text, "", _time(us), ""
    if (us := value(parts, "case", "ours.sweep")) == us:
        whole = value(parts, "case", "ours.sweep.whole")
        yield "a sweep on all cores, once its workers run", "", f"{us:.1f} runs/s", ""
        yield "- with their start, 80 runs", "", f"{whole:.1f} runs/s", ""


def checks(parts: Parts) -> Iterator[tuple[str, ...]]:
    """Yield each number of issue 14 with its limit and verdict."""
    for criterion in CRITERIA:
        yield criterion.text, *criterion.verdict(parts)


def machines(parts: Parts) -> Iterator[str]:
    """Yield a line on the machine, its load and the versions of each part."""
    for name, part in parts.items():
        loads = f"load {part.loads[0]:g} before, {max(part.loads[1:], default=part.loads[0]):g} at most during"
        versions = ", ".join(f"{package} {part.versions[package]}" for package in RIVALS if package in part.versions)
        yield (
            f"- `{name}`: {part.began}, commit {part.commit}, {part.seconds:.0f} s; {part.machine}; {loads}, other "
            f"programs {100 * part.others:.0f} % of the processors; {versions}"
        )
        yield from (f"  - left out: {measure}: {reason}" for measure, reason in part.left_out.items())


def text_of(parts: Parts) -> str:
    """Return the tables as plain text."""
    lines = [f"{'':58}{'theirs':>11}{'ours':>13}{'ratio':>8}"]
    lines += [f"{text:58}{them:>11}{us:>13}{ratio:>8}" for text, them, us, ratio in comparison(parts)]
    lines += ["", *(f"{text:58}{found:>11} {limit:>13}  {verdict}" for text, found, limit, verdict in checks(parts))]
    return "\n".join([*lines, "", *machines(parts)])


def _time(seconds: float) -> str:
    if seconds != seconds:
        return "left out"
    return f"{1e3 * seconds:.3g} ms" if seconds < 0.1 else f"{seconds:.3g} s"


def _table(head: tuple[str, ...], rows: Any) -> str:
    lines = [head, ("---",) * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _shares(parts: Parts) -> Iterator[tuple[str, ...]]:
    if "case" not in parts:
        return
    found = {
        name.removeprefix("share."): parts["case"].median(name)
        for name in parts["case"].values
        if name.startswith("share.") and not name.endswith("all ticks")
    }
    for part, seconds in sorted(found.items(), key=lambda item: -item[1]):
        yield part, f"{1e3 * seconds:.0f}", f"{100 * seconds / sum(found.values()):.0f}"


def _sizes(part: PartRun, prefix: str) -> tuple[list[int], list[float]]:
    """Return numbers of agents, and medians, of the values with a prefix."""
    found = {int(name.removeprefix(prefix)): part.median(name) for name in part.values if name.startswith(prefix)}
    return sorted(found), [found[n] for n in sorted(found)]


def _draw_agents(part: PartRun) -> Figure:
    figure = Figure(figsize=(8.0, 3.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    for who, name in NAMES.items():
        for graph, dash in (("full", "-"), ("ring", "--")):
            n, seconds = _sizes(part, f"{who}.{graph}.")
            if not n:
                continue
            style: dict[str, Any] = {"color": COLOURS[who], "linestyle": dash, "marker": "o", "markersize": 3}
            left.plot(n, [1e3 * each for each in seconds], label=f"{name}, {graph}", **style)
            right.plot([links(graph, k) for k in n], [1e3 * each for each in seconds], **style)
    left.set(xlabel="agents, a process each", ylabel="time per tick (ms)", yscale="log")
    right.set(xlabel="messages per tick", xscale="log", yscale="log")
    left.legend(fontsize=7)
    return figure


def _draw_links(part: PartRun) -> Figure:
    figure = Figure(figsize=(8.0, 3.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    for graph in ("ring", "full"):
        n, seconds = _sizes(part, f"inprocess.link.{graph}.")
        style: dict[str, Any] = {"color": COLOURS[graph], "marker": "o", "markersize": 3, "label": graph}
        left.plot(n, [1e6 * each for each in seconds], **style)
        n, seconds = _sizes(part, f"inprocess.tick.{graph}.")
        right.plot(n, [1e3 * each for each in seconds], **style)
    left.set(xlabel="agents, one process", ylabel="message (µs), without plant", xscale="log", ylim=(0, None))
    right.set(xlabel="agents, one process", ylabel="tick (ms), with plant", xscale="log", yscale="log")
    left.legend(fontsize=8)
    return figure
