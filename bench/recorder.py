"""The cost of the record `run.mcap`: runs with each level of it beside the same run without, in turns.

    python -m bench.recorder                                   all parts, some minutes
    python -m bench.recorder inprocess links --rounds 31       some of them, in more rounds
    python -m bench.recorder --write docs/recorder.md          all, and the table of that page anew

`inprocess` is the islanding in one process from the start of the plant to the last file; `links` the same with emulated
links that change at every tick (flapping, case "fast"), where messages are sent and decisions differ from tick to tick;
`processes` a tick of ten processes in simulated time; `wall` late steps in wall-clock time. In one process it is
processor time, with processes the clock. Everything runs in turns, the order changes from round to round, and a ratio
is that of a time to the two of its round without a record. Where others use the machine: put `chrt --rr 1` before it.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from statistics import median
from time import process_time
from typing import Literal, NamedTuple

import msgspec

from bench.harness import load, machine, say
from scenarios.drivers.inprocess import run_inprocess
from scenarios.drivers.outcome import Outcome
from scenarios.drivers.process_driver import run_processes
from scenarios.record.record_info import RecordInfo
from scenarios.results.record import Recorder
from scenarios.schema import load_scenario
from scenarios.schema.configs import configs
from scenarios.schema.participants import inverters_of
from scenarios.schema.scenario_writing import to_toml
from scenarios.versions import versions
from wire.journal import RecordLevel

Level = Literal["none", "physics", "decisions", "all"]

LEVELS: tuple[Level, ...] = ("none", "physics", "decisions", "all")
"""The reference first."""

TARGET = 1.05
"""Issue 15: a record costs less than 5 % of a lock-step run."""

BEGIN, END = "<!-- python -m bench.recorder -->", "<!-- end -->"
"""Lines around the table in the page."""


class Case(NamedTuple):
    """A case of a scenario, and how it is run."""

    scenario: str
    case: str
    seconds: float
    """Run time (s)."""
    processes: bool = False
    wall: bool = False


PARTS = {
    "inprocess": Case("islanding", "IV", 7.0),
    "links": Case("flapping", "fast", 12.0),
    "processes": Case("islanding", "IV", 7.0, processes=True),
    "wall": Case("islanding", "IV", 12.0, processes=True, wall=True),
}


class Run(NamedTuple):
    """One run."""

    seconds: float
    """Processor time of this process from the start of the plant to the last file (s)."""
    outcome: Outcome
    bytes: int
    """Size of its record."""


def run(case: Case, level: Level) -> Run:
    """Run a case with a level of the record; its folder goes afterwards."""
    model, feeder = load_scenario(case.scenario)
    model = msgspec.structs.replace(model, time=msgspec.structs.replace(model.time, end_s=case.seconds))
    plant, agents = configs(model, feeder, case.case, "tcp/127.0.0.1:0" if case.processes else "")
    kept: RecordLevel = "physics" if level == "none" else level
    changes = {"record": kept, "clock": "wall" if case.wall else "simulated"}
    plant = msgspec.structs.replace(plant, **changes)
    agents = tuple(msgspec.structs.replace(agent, **changes) for agent in agents)
    with tempfile.TemporaryDirectory(prefix="gridpeers-record-") as name:
        toml = to_toml(model, versions())  # a run has it for its folder anyway
        folder, began = Path(name) / "case", process_time()
        record = None
        if level != "none":
            record = RecordInfo(
                level=kept,
                scenario=model.name,
                case=case.case,
                toml=toml,
                seed=model.seed,
                driver="processes" if case.processes else "inprocess",
                versions=versions(),
                inverters=tuple(row.name for row in inverters_of(model, feeder)),
                plant=plant,
                agents=agents,
            )
        with Recorder(folder, gaps=case.wall, record=record) as recorder:
            if case.processes:
                outcome = run_processes(
                    plant, agents, Path(name) / "log", recorder, on_links=recorder, on_journal=recorder
                )
            else:
                outcome = run_inprocess(plant, agents, recorder, on_links=recorder, on_journal=recorder)
            assert not outcome.broke, outcome.broke
            recorder.finish(recorder.ended, recorder.record_step)
        assert not recorder.record_failure, recorder.record_failure
        file = folder / "run.mcap"
        return Run(process_time() - began, outcome, file.stat().st_size if file.exists() else 0)


def _time(case: Case, done: Run) -> float:
    """Return the time (ms) that counts: of the whole run in one process, of a tick with processes."""
    if not case.processes:
        return 1e3 * done.seconds
    outcome = done.outcome
    return 1e3 * outcome.run_s / outcome.ticks


def in_turns(case: Case, rounds: int) -> dict[Level, list[Run]]:
    """Run all levels, round by round in changing order, the reference before and after each round."""
    runs: dict[Level, list[Run]] = {level: [] for level in LEVELS}
    others = LEVELS[1:]
    run(case, "all")  # loads the compiled step, and what else is loaded once
    for i in range(rounds):
        order: Sequence[Level] = ("none", *others[i % 3 :], *others[: i % 3], "none")
        for level in order:
            runs[level].append(run(case, level))
    return runs


def costs(name: str, case: Case, rounds: int) -> list[str]:
    """Measure a case in simulated time; return the rows of the table, and print whether the target is met."""
    what = {
        "inprocess": f"a case of {case.seconds:g} s in one process, its plant included (ms of processor time)",
        "links": f"the same with emulated links that change at every tick, {case.seconds:g} s (ms)",
        "processes": "a tick, ten processes (ms)",
    }[name]
    runs = in_turns(case, rounds)
    times = {level: [_time(case, done) for done in of] for level, of in runs.items()}
    around = [(before + after) / 2.0 for before, after in zip(times["none"][::2], times["none"][1::2], strict=True)]
    rows = [f"| {what}, {rounds} rounds | none | {median(times['none']):.4g} | {min(times['none']):.4g} | | {load()} |"]
    for level in LEVELS[1:]:
        of = [time / reference for time, reference in zip(times[level], around, strict=True)]
        fastest = min(times[level]) / min(times["none"])
        ratio = f"{median(of):.3f} ({fastest:.3f})"
        rows.append(f"| | {level} | {median(times[level]):.4g} | {min(times[level]):.4g} | {ratio} | |")
        if level == "all":
            met = "met" if median(of) < TARGET else "MISSED"
            print(f"{name}: all costs {median(of) - 1.0:+.1%} (by the fastest {fastest - 1.0:+.1%}): under 5 % {met}")
    return rows


def lateness(case: Case, rounds: int) -> list[str]:
    """Measure late steps of the plant in wall-clock time, with and without a record; return the rows of the table."""
    rows = []
    runs: dict[Level, list[Run]] = {"none": [], "all": []}
    run(case, "all")
    for i in range(rounds):
        for level in (("none", "all"), ("all", "none"))[i % 2]:
            runs[level].append(run(case, level))
    for level, of in runs.items():
        paces = [done.outcome.pacing for done in of if done.outcome.pacing is not None]
        late, steps = sum(pace.late for pace in paces), sum(pace.steps for pace in paces)
        p99 = ", ".join(f"{1e3 * pace.p99:.1f}" for pace in paces)
        text = f"wall-clock time, {rounds} runs of {case.seconds:g} s: late steps of {steps}"
        rows.append(f"| {text} | {level} | {late} | | | {load()} |")
        rows.append(f"| - 99th percentile of a step's delay (ms) | {level} | {p99} | | | |")
    return rows


def main() -> None:
    """Measure, print the table, and write it where it is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"{', '.join(PARTS)}; all by default")
    parser.add_argument("--rounds", type=int, default=0, help="rounds of each part (default: 21, 11, 6, 3)")
    parser.add_argument("--write", type=Path, metavar="PAGE", help="write the table between its marks in a page")
    given = parser.parse_args()
    if unknown := [name for name in given.parts if name not in PARTS]:
        parser.error(f'part "{unknown[0]}": there is no such part; choose from {", ".join(PARTS)}')
    print(machine())
    rounds = dict(zip(PARTS, (21, 11, 6, 3), strict=True))
    table = ["| | record | median | fastest | ratio (of the fastest) | load |", "|---|---|---|---|---|---|"]
    for name in given.parts or PARTS:
        say(name)
        measure: Callable[[], list[str]] = partial(lateness if PARTS[name].wall else partial(costs, name), PARTS[name],
                                                   given.rounds or rounds[name])  # fmt: skip
        table += measure()
    text = "\n".join(table)
    print(text)
    if given.write:
        page = given.write.read_text(encoding="utf-8")
        before, _, rest = page.partition(BEGIN)
        after = rest.partition(END)[2]
        if not after:
            parser.error(f"{given.write}: has no lines {BEGIN} and {END}")
        whole = f"{before}{BEGIN}\n{machine()}\n\n{text}\n{END}{after}"
        given.write.write_text(whole, encoding="utf-8")


if __name__ == "__main__":
    main()
