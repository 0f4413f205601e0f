"""A campaign: many runs with disturbances, what they violate, and each kind of failure shrunk to a scenario file."""

from __future__ import annotations

import csv
import json
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, closing, suppress
from dataclasses import dataclass, replace
from io import StringIO
from pathlib import Path
from types import MappingProxyType

import msgspec

from gridpeers.lab.chaos.chaos_run import (
    ASKED,
    REPEATS,
    SAME_IN_PROCESSES,
    ChaosRow,
    MachineError,
    compared,
    run_schedule,
)
from gridpeers.lab.chaos.disturbed_scenario import KINDS, ChaosBase, Schedule, base_of
from gridpeers.lab.chaos.schedules import BATCH, drawn, shrunk
from gridpeers.plant.request_process import TransientFolder
from gridpeers.scenarios.checks.check_registry import RETURNS, chosen_checks
from gridpeers.scenarios.results.run_files import (
    JOURNAL,
    FolderError,
    journal_line,
    open_journal,
    refusal,
    rows_in,
    set_broken,
    set_complete,
    shown,
    write_whole,
)
from gridpeers.scenarios.run_request import Driver
from gridpeers.scenarios.schema.plugin_keys import with_relative_folders
from gridpeers.scenarios.schema.scenario_writing import to_toml
from gridpeers.scenarios.sweep.workers import on_workers
from gridpeers.wire.driver.command_line import command_line
from gridpeers.wire.wording import counted

REPEATED = 20
"""Each run whose number is a multiple of this one is done twice, by any worker that is free."""

Stage = Callable[[float], AbstractContextManager[Callable[[str, float], None]]]
"""Begins a stage of so many parts: its function takes the present work, and how many parts are done."""


@dataclass(frozen=True, kw_only=True)
class Campaign:
    base: ChaosBase
    seed: int
    runs: int
    driver: Driver = "inprocess"
    jobs: int = 1
    dask: str = ""
    """Address of a Dask scheduler to use instead; its workers have their own folders for temporary files."""


@dataclass(frozen=True, kw_only=True)
class Failure:
    violated: str
    row: ChaosRow
    """The run in which it was found, among those with the fewest disturbances."""
    simplest: ChaosRow
    """The run of the simplest schedule found for it."""
    file: Path


@dataclass(frozen=True, kw_only=True)
class Summary:
    campaign: Campaign
    rows: dict[int, ChaosRow]
    failures: tuple[Failure, ...]

    @property
    def violated(self) -> int:
        return sum(bool(row.violated) for row in self.rows.values())

    def lines(self) -> Iterator[str]:
        base, rows = self.campaign.base, self.rows.values()
        how = "in one process each" if self.campaign.driver == "inprocess" else "with processes"
        numbers = Counter(it.kind for row in rows for it in base.effective(row.schedule))
        drawn = ", ".join(f"{kind} {numbers[kind]}" for kind in KINDS if numbers[kind]) or "none"
        head = f"{base.scenario.name}, case {base.case}: {len(rows)} of {self.campaign.runs} runs {how}"
        yield f"{head}, seed {self.campaign.seed}; disturbances: {drawn}"
        yield f"{'asked':18} {'judged':>7} {'violated':>9}  first"
        for name in dict.fromkeys((*ASKED, *chosen_checks(base.scenario.checks), RETURNS)):
            passed = sum(name in row.passed for row in rows)
            failed = sorted(row.number for row in rows if name in row.violated)
            if passed or failed:
                first = f"run {failed[0]}" if failed else ""
                yield f"{name:18} {passed + len(failed):7} {len(failed):9}  {first}".rstrip()
        collapses = sum(bool(row.collapse) for row in rows)
        beyond = f"; {collapses} with a collapse that no control prevents, and that lasts" if collapses else ""
        yield f"{self.violated} of {len(rows)} runs violated anything; {sum(row.trips for row in rows)} trips{beyond}"
        for failure in self.failures:  # of the run as found if the simplest one passes the next time
            name, found = failure.violated, failure.row
            yield f"{name}, run {found.number}: {failure.simplest.violated.get(name, found.violated[name])}"
            yield from (f"    {line}" for line in base.lines(failure.simplest.schedule))
            yield f"    {again(failure.file)}"


def run_campaign(campaign: Campaign, folder: ChaosFolder, stage: Stage) -> Summary:
    """Do the runs that the folder lacks, shrink what fails, and write all of it, also what came until an interruption.

    MachineError if the machine lacks what a run needs: that is no failure of the scenario, and nothing is shrunk.
    """
    failures: dict[str, Failure] = {}
    try:
        with closing(TransientFolder("gridpeers-chaos-")) as temporary:  # workers that are ended leave theirs in it
            within = None if campaign.dask else temporary.path
            _do_runs(campaign, folder, stage, within)
            _add_failures(failures, folder)
            _shrink_all(campaign, folder, failures, stage, within)
        summary = _concluded(campaign, folder, failures)
        set_complete(folder.path)
    except BaseException as error:
        why = refusal(folder.path, error) if isinstance(error, OSError) else str(error) or type(error).__name__
        why = "interrupted" if isinstance(error, KeyboardInterrupt) else why
        set_broken(folder.path, f"{why} after {len(folder.rows)} of {campaign.runs} runs")
        with suppress(OSError):  # a full disk may take no more of them; the error above is the one to tell
            _add_failures(failures, folder)
            _concluded(campaign, folder, failures)
        raise
    return summary


def _do_runs(campaign: Campaign, folder: ChaosFolder, stage: Stage, within: Path | None) -> None:
    text, seed, driver = campaign.base.text, campaign.seed, campaign.driver
    calls = ((text, seed, number, it, driver, within) for number, it in _numbered(campaign, dict(folder.rows)))
    jobs = 1 if driver == "processes" else campaign.jobs
    head, of = campaign.base.scenario.name, campaign.runs
    with stage(of) as tell, closing(on_workers(calls, jobs, run_number, campaign.dask)) as results:
        tell(f"{head}, {len(folder.rows)} of {of} runs", len(folder.rows))
        for row in results:
            first = folder.rows.get(row.number)
            folder.add(row if first is None else compared(first, row, REPEATS))
            done, bad = len(folder.rows), sum(bool(row.violated) for row in folder.rows.values())
            tell(f"{head}, {done} of {of} runs, {bad} violated", done)


def _numbered(campaign: Campaign, known: Mapping[int, ChaosRow]) -> Iterator[tuple[int, Schedule]]:
    for batch in range(-(-campaign.runs // BATCH)):
        numbers = range(batch * BATCH, min((batch + 1) * BATCH, campaign.runs))
        once = {number for number in numbers if number not in known}
        twice = {n for n in numbers if n % REPEATED == 0 and (n in once or REPEATS not in known[n].passed)}
        if not once | twice:
            continue
        schedules = dict(zip(numbers, drawn(campaign.base, campaign.seed, batch), strict=False))
        yield from ((number, schedules[number]) for which in (once, twice) for number in sorted(which))


def _add_failures(failures: dict[str, Failure], folder: ChaosFolder) -> None:
    rows = sorted(folder.rows.values(), key=lambda row: (len(row.schedule), row.number))
    for violated in sorted({name for row in rows for name in row.violated} - failures.keys()):
        row = next(row for row in rows if violated in row.violated)
        file = folder.write_failure(violated, row, row)
        failures[violated] = Failure(violated=violated, row=row, simplest=row, file=file)


def _shrink_all(
    campaign: Campaign, folder: ChaosFolder, failures: dict[str, Failure], stage: Stage, within: Path | None
) -> None:
    if not failures:
        return
    kinds = counted(len(failures), "kind of failure", "kinds of failure")
    calls = []
    for name, it in failures.items():  # processes only for a failure that one process cannot show
        driver = campaign.driver if name in (SAME_IN_PROCESSES, REPEATS) else "inprocess"
        calls.append((campaign.base.text, campaign.seed, it.row.number, name, driver, within))
    workers = on_workers(calls, min(campaign.jobs, len(calls)), shrink_number, campaign.dask)
    with stage(len(failures)) as tell, closing(workers) as simpler:
        tell(f"shrinking, 0 of {kinds}", 0)
        for done, (violated, simplest) in enumerate(simpler, start=1):
            found = failures[violated]
            file = folder.write_failure(violated, found.row, simplest)
            failures[violated] = replace(found, simplest=simplest, file=file)
            tell(f"shrinking, {done} of {kinds}", done)


def _concluded(campaign: Campaign, folder: ChaosFolder, failures: dict[str, Failure]) -> Summary:
    folder.write_table()
    summary = Summary(campaign=campaign, rows=folder.rows, failures=tuple(failures.values()))
    write_whole(folder.path / "report.txt", "\n".join(summary.lines()) + "\n")
    return summary


# -------------------------------------------------------------------- on a worker


def run_number(
    text: str, seed: int, number: int, schedule: Schedule, driver: Driver, within: Path | None = None
) -> ChaosRow:
    """Do a run of the campaign with a seed; `text` is that of its base, so that any process can do it."""
    return run_schedule(base_of(text), schedule, seed_of(seed, number), number, driver, within=within)


def shrink_number(
    text: str, seed: int, number: int, violated: str, driver: Driver, within: Path | None = None
) -> tuple[str, ChaosRow]:
    """Return the check that a run violates, and the run of the simplest schedule found that violates it, too."""
    base = base_of(text)
    rows: dict[bytes, ChaosRow] = {}
    lacks: list[MachineError] = []

    def row_of(schedule: Schedule) -> ChaosRow:
        again = violated == REPEATS
        row = run_schedule(base, schedule, seed_of(seed, number), number, driver, again=again, within=within)
        return rows.setdefault(msgspec.json.encode(schedule), row)

    def fails(schedule: Schedule) -> bool:
        try:
            return violated in row_of(schedule).violated
        except MachineError as error:
            lacks.append(error)
            raise KeyboardInterrupt from error  # hypothesis would take an `Exception` for a failure, and shrink it

    try:
        simplest = shrunk(base, seed, number, fails)
    except KeyboardInterrupt:
        if lacks:
            raise lacks[0] from None
        raise
    # that of the run itself is not run to shrink it
    return violated, rows.get(msgspec.json.encode(simplest)) or row_of(simplest)


# -------------------------------------------------------------------- its folder


SCENARIO, SETTINGS = "scenario.toml", "asked.json"
"""Files from which a campaign goes on, beside its journal: its scenario; its seed and its number of runs."""

RUNS = 100

SEEDS = 1_000_000
"""Seeds of the messages' fates for each seed of a campaign: run n has one of its own."""

COLUMNS = (
    *("run", "seed", "status", "violated", "why", "disturbances", "schedule"),
    *("passed", "trips", "since_s", "history_sha256", "links_sha256", "took_s"),
)


def seed_of(seed: int, number: int) -> int:
    return seed * SEEDS + number


def again(file: Path) -> str:
    return command_line("run", shown(file), "--driver", "inprocess", "--require-checks")


class ChaosFolder:
    def __init__(
        self,
        path: Path,
        base: ChaosBase,
        seed: int,
        command: str,
        rows: Mapping[int, ChaosRow] = MappingProxyType({}),
        runs: int = RUNS,
    ) -> None:
        self.path, self._base, self._seed, self._command = path, base, seed, command
        self.rows = dict(rows)
        write_whole(path / SCENARIO, base.text)
        write_whole(path / SETTINGS, json.dumps({"seed": seed, "runs": runs}) + "\n")
        open_journal(path).close()
        self.write_table()

    def add(self, row: ChaosRow) -> None:
        with (self.path / JOURNAL).open("ab") as file:
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
                    *(row.number, seed_of(self._seed, row.number), row.status, " ".join(sorted(row.violated))),
                    *("; ".join(filter(None, why)), len(row.schedule), json.dumps(msgspec.to_builtins(row.schedule))),
                    *(" ".join(row.passed), row.trips, row.since_s, row.history_sha256, row.links_sha256, row.took_s),
                )
            )
        write_whole(self.path / "chaos.csv", text.getvalue())

    def write_failure(self, violated: str, row: ChaosRow, simplest: ChaosRow) -> Path:
        """Write the scenario of a failure of a run, as it is or as it was shrunk; return its file."""
        file = self.path / "failures" / f"{violated}.toml"
        file.parent.mkdir(exist_ok=True)
        seed, schedule = seed_of(self._seed, row.number), simplest.schedule
        fewer = len(schedule) < len(row.schedule)
        remarks = [
            f"Found by chaos: {simplest.violated.get(violated, row.violated[violated])}"[:300],
            f"{self._command}, run {row.number}, seed of the messages {seed}"
            + (f", shrunk from {len(row.schedule)} disturbances to {len(schedule)}" if fewer else ""),
            f"Once more: {again(file)}",
            *(f"  {line}" for line in self._base.lines(schedule)),
        ]
        scenario = msgspec.structs.replace(
            self._base.disturbed(schedule, seed, simplest.since_s),
            name=f"{self._base.scenario.name[:16]}-{violated}"[:31],
            title="",
        )
        scenario = with_relative_folders(scenario, file.parent)
        write_whole(file, to_toml(scenario, {}, [remark.replace("\n", " ") for remark in remarks], terse=True))
        return file


def asked_of(folder: Path) -> tuple[int, int]:
    """Return the seed and the number of runs with which a campaign was begun; FolderError if it is no such folder."""
    try:
        found = json.loads((folder / SETTINGS).read_text(encoding="utf-8"))
        return int(found["seed"]), int(found["runs"])
    except (OSError, ValueError, LookupError, TypeError) as error:
        why = error.strerror if isinstance(error, OSError) else f"its {SETTINGS} is damaged"
        raise FolderError(
            f"--resume {folder}: no folder of a campaign: {why}; name one with {SCENARIO} and {SETTINGS}"
        ) from None


def kept_rows(folder: Path, base: ChaosBase, seed: int, driver: Driver, runs: int) -> dict[int, ChaosRow]:
    """Return the runs that a campaign has in its folder, for one that goes on there.

    Runs in one process are none of a campaign with processes. FolderError if the folder is of a campaign with another
    scenario, another seed or more runs, or is damaged.
    """
    where, (theirs, _) = f"--resume {folder}", asked_of(folder)
    try:
        if (folder / SCENARIO).read_text(encoding="utf-8") != base.text:
            raise FolderError(f"{where}: its {SCENARIO} is not the scenario and case to disturb; take a new folder")
        rows = rows_in(folder, ChaosRow, lambda row: "")
    except OSError as error:
        raise FolderError(f"{where}: no folder of a campaign: {error.strerror}") from None
    if theirs != seed:
        raise FolderError(f"{where}: it was begun with --seed {theirs}, not {seed}; give that one")
    if rows and (last := max(rows)) >= runs:
        raise FolderError(f"{where}: it has run {last} already; give --runs {last + 1} or more")
    here = {SAME_IN_PROCESSES} if driver == "processes" else set()
    return {number: row for number, row in rows.items() if here <= {*row.passed, *row.violated}}
