"""A campaign: many runs with disturbances, what they violate, and each kind of failure shrunk to a scenario file.

Its folder has a line for each run in chaos.csv, and the scenario of each kind of failure.
"""

from __future__ import annotations

import csv
import json
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, closing, suppress
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import msgspec

from gridpeers.lab.chaos.chaos_run import ASKED, REPEATS, SAME_IN_PROCESSES, ChaosRow, compared, run_schedule
from gridpeers.lab.chaos.disturbed_scenario import KINDS, ChaosBase, Schedule, base_of, in_order
from gridpeers.lab.chaos.schedules import BATCH, drawn, shrunk
from gridpeers.scenarios.checks.check_registry import RETURNS, chosen_checks
from gridpeers.scenarios.results.run_files import (
    JOURNAL,
    journal_line,
    refusal,
    set_broken,
    set_complete,
    shown,
    write_whole,
)
from gridpeers.scenarios.run_request import Driver
from gridpeers.scenarios.schema.scenario_writing import to_toml
from gridpeers.scenarios.sweep.workers import on_workers
from gridpeers.wire.driver.command_line import command_line
from gridpeers.wire.wording import counted

REPEATED = 20  # Interval of runs that are repeated, by any free worker
SEEDS = 1_000_000  # Number of seeds for the fates of messages per seed of a campaign: each run has its own

COLUMNS = (
    *("run", "seed", "status", "violated", "why", "disturbances", "schedule"),
    *("passed", "trips", "since_s", "history_sha256", "links_sha256", "took_s"),
)

Stage = Callable[[float], AbstractContextManager[Callable[[str, float], None]]]
"""Begins a stage of so many parts: its function takes the present work, and how many parts are done."""


class Failure(NamedTuple):
    row: ChaosRow
    """The run in which it was found, among those with the fewest disturbances."""
    simplest: ChaosRow
    """The run of the simplest failing schedule."""
    file: Path


@dataclass(kw_only=True)
class Campaign:
    base: ChaosBase
    seed: int
    runs: int
    driver: Driver = "inprocess"
    jobs: int = 1
    path: Path | None = None
    command: str = ""
    rows: dict[int, ChaosRow] = field(default_factory=dict)
    failures: dict[str, Failure] = field(default_factory=dict)
    """By the check that is violated."""

    def run(self, stage: Stage) -> None:
        """Do the runs, shrink the failures, and write all results, also after an interruption."""
        try:
            with TemporaryDirectory(prefix="gridpeers-chaos-", ignore_cleanup_errors=True) as temporary:
                self._do_runs(stage, Path(temporary))
                self._add_failures()
                self._shrink_all(stage, Path(temporary))
            self._conclude()
            set_complete(self._file())
        except BaseException as error:
            why = refusal(self._file(), error) if isinstance(error, OSError) else str(error) or type(error).__name__
            why = "interrupted" if isinstance(error, KeyboardInterrupt) else why
            set_broken(self._file(), f"{why} after {len(self.rows)} of {self.runs} runs")
            with suppress(OSError):  # a full disk may take no more of them; the error above is the one to tell
                self._add_failures()
                self._conclude()
            raise

    def _do_runs(self, stage: Stage, within: Path) -> None:
        text, driver = self.base.text, self.driver
        calls = ((text, self.seed, number, schedule, driver, within) for number, schedule in self._schedules())
        jobs = 1 if driver == "processes" else self.jobs
        with stage(self.runs) as tell, closing(on_workers(calls, jobs, run_number)) as results:
            progress = f"{self.base.scenario.name}, {{}} of {self.runs} runs"
            tell(progress.format(0), 0)
            for row in results:
                first = self.rows.get(row.number)
                self.add(row if first is None else compared(first, row, REPEATS))
                tell(f"{progress.format(len(self.rows))}, {self.violated} violated", len(self.rows))

    def _schedules(self) -> Iterator[tuple[int, Schedule]]:
        for batch in range(-(-self.runs // BATCH)):
            numbers = range(batch * BATCH, min((batch + 1) * BATCH, self.runs))
            schedules = dict(zip(numbers, drawn(self.base, self.seed, batch), strict=False))
            yield from schedules.items()
            yield from ((number, schedule) for number, schedule in schedules.items() if number % REPEATED == 0)

    def _add_failures(self) -> None:
        rows = sorted(self.rows.values(), key=lambda row: (len(row.schedule), row.number))
        for violated in sorted({name for row in rows for name in row.violated} - self.failures.keys()):
            row = next(row for row in rows if violated in row.violated)
            self.failures[violated] = Failure(row, row, self.write_failure(violated, row, row))

    def _shrink_all(self, stage: Stage, within: Path) -> None:
        if not self.failures:
            return
        kinds = counted(len(self.failures), "kind of failure", "kinds of failure")
        calls = []
        for name, it in self.failures.items():  # processes only for a failure that one process cannot show
            driver = self.driver if name in (SAME_IN_PROCESSES, REPEATS) else "inprocess"
            calls.append((self.base.text, self.seed, it.row.number, name, driver, within))
        workers = on_workers(calls, min(self.jobs, len(calls)), shrink_number)
        with stage(len(calls)) as tell, closing(workers) as simpler:
            tell(f"shrinking, 0 of {kinds}", 0)
            for done, (violated, simplest) in enumerate(simpler, start=1):
                row = self.failures[violated].row
                self.failures[violated] = Failure(row, simplest, self.write_failure(violated, row, simplest))
                tell(f"shrinking, {done} of {kinds}", done)

    # ---------------------------------------------------------------- its report

    @property
    def violated(self) -> int:
        return sum(bool(row.violated) for row in self.rows.values())

    def lines(self) -> Iterator[str]:
        base, rows = self.base, self.rows.values()
        how = "in one process each" if self.driver == "inprocess" else "with processes"
        numbers = Counter(it.kind for row in rows for it in row.schedule)
        drawn = ", ".join(f"{kind} {numbers[kind]}" for kind in KINDS if numbers[kind]) or "none"
        head = f"{base.scenario.name}, case {base.case}: {len(rows)} of {self.runs} runs {how}"
        yield f"{head}, seed {self.seed}; disturbances: {drawn}"
        yield f"{'asked':18} {'judged':>7} {'violated':>9}  first"
        for name in dict.fromkeys((*ASKED, *chosen_checks(base.scenario.checks), RETURNS)):
            passed = sum(name in row.passed for row in rows)
            failed = sorted(row.number for row in rows if name in row.violated)
            if passed or failed:
                first = f"run {failed[0]}" if failed else ""
                yield f"{name:18} {passed + len(failed):7} {len(failed):9}  {first}".rstrip()
        collapses = sum(bool(row.collapse) for row in rows)
        beyond = f"; {collapses} with a lasting collapse that no control prevents" if collapses else ""
        yield f"{self.violated} of {len(rows)} runs violated a check; {sum(row.trips for row in rows)} trips{beyond}"
        for name, (found, simplest, file) in self.failures.items():
            # of the run as found if the simplest one passes the next time
            yield f"{name}, run {found.number}: {simplest.violated.get(name, found.violated[name])}"
            yield from (f"    {it}" for it in in_order(simplest.schedule))
            yield f"    {again(file)}"

    # ---------------------------------------------------------------- its folder

    def _file(self, name: str = "") -> Path:
        assert self.path is not None
        return self.path / name

    def begin(self) -> None:
        write_whole(self._file("scenario.toml"), self.base.text)
        self.write_table()

    def add(self, row: ChaosRow) -> None:
        with self._file(JOURNAL).open("ab") as file:
            file.write(journal_line(row))
        self.rows[row.number] = row  # only now that it is kept: after an error the command counts these rows

    def write_table(self) -> None:
        text = StringIO()
        table = csv.writer(text, lineterminator="\n")
        table.writerow(COLUMNS)
        for _, row in sorted(self.rows.items()):
            why = [*(row.violated[it] for it in sorted(row.violated)), row.collapse, row.unsettled]
            table.writerow(
                (
                    *(row.number, seed_of(self.seed, row.number), row.status, " ".join(sorted(row.violated))),
                    *("; ".join(filter(None, why)), len(row.schedule), json.dumps(msgspec.to_builtins(row.schedule))),
                    *(" ".join(row.passed), row.trips, row.since_s, row.history_sha256, row.links_sha256, row.took_s),
                )
            )
        write_whole(self._file("chaos.csv"), text.getvalue())

    def write_failure(self, violated: str, row: ChaosRow, simplest: ChaosRow) -> Path:
        file = self._file("failures") / f"{violated}.toml"
        file.parent.mkdir(exist_ok=True)
        seed, schedule = seed_of(self.seed, row.number), simplest.schedule
        fewer = len(schedule) < len(row.schedule)
        remarks = [
            f"Found by chaos: {simplest.violated.get(violated, row.violated[violated])}"[:300],
            f"{self.command}, run {row.number}, seed of the messages {seed}"
            + (f", shrunk from {len(row.schedule)} disturbances to {len(schedule)}" if fewer else ""),
            f"Repeat: {again(file)}",
            *(f"  {it}" for it in in_order(schedule)),
        ]
        scenario = msgspec.structs.replace(
            self.base.disturbed(schedule, seed, simplest.since_s),
            name=f"{self.base.scenario.name[:16]}-{violated}"[:31],
            title="",
        )
        write_whole(file, to_toml(scenario, {}, [remark.replace("\n", " ") for remark in remarks], terse=True))
        return file

    def _conclude(self) -> None:
        self.write_table()
        write_whole(self._file("report.txt"), "\n".join(self.lines()) + "\n")


def seed_of(seed: int, number: int) -> int:
    return seed * SEEDS + number


def again(file: Path) -> str:
    return command_line("run", shown(file), "--driver", "inprocess", "--require-checks")


# -------------------------------------------------------------------- on a worker


def run_number(
    text: str, seed: int, number: int, schedule: Schedule, driver: Driver, within: Path | None = None
) -> ChaosRow:
    """Do a run of the campaign with a seed; `text` is that of its base, so that any process can do it."""
    return run_schedule(base_of(text), schedule, seed_of(seed, number), number, driver, within=within)


def shrink_number(
    text: str, seed: int, number: int, violated: str, driver: Driver, within: Path | None = None
) -> tuple[str, ChaosRow]:
    """Return the check that a run violates, and the run of the simplest schedule that also violates it."""
    base = base_of(text)
    rows: dict[bytes, ChaosRow] = {}

    def row_of(schedule: Schedule) -> ChaosRow:
        repeats = violated == REPEATS
        row = run_schedule(base, schedule, seed_of(seed, number), number, driver, again=repeats, within=within)
        return rows.setdefault(msgspec.json.encode(schedule), row)

    simplest = shrunk(base, seed, number, lambda schedule: violated in row_of(schedule).violated)
    # that of the run itself is not run to shrink it
    return violated, rows.get(msgspec.json.encode(simplest)) or row_of(simplest)
