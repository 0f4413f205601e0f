"""The folder of a campaign: a line for each run in chaos.csv, and a scenario file for each kind of failure."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Mapping
from functools import partial
from io import StringIO
from pathlib import Path
from types import MappingProxyType

import msgspec

from gridpeers.lab.chaos.chaos_run import SAME_IN_PROCESSES, ChaosRow
from gridpeers.lab.chaos.disturbed_scenario import ChaosBase
from gridpeers.lab.chaos.numbered_run import seed_of
from gridpeers.lab.chaos.row_problem import row_problem
from gridpeers.lab.chaos.schedule_report import schedule_lines
from gridpeers.scenarios.results.run_files import FolderError, shown, write_whole
from gridpeers.scenarios.results.run_journal import JOURNAL, journal_line, open_journal, rows_in
from gridpeers.scenarios.run_request import Driver
from gridpeers.scenarios.schema.plugin_keys import with_relative_folders
from gridpeers.scenarios.schema.scenario_writing import to_toml
from gridpeers.wire.driver.command_line import command_line

SCENARIO, SEED = "scenario.toml", "seed.txt"
"""Files from which a campaign goes on, beside its journal."""

ASKED, RUNS = "runs_asked.txt", 100
"""File with the number of runs that a campaign was asked for, and that number if nobody says one."""

GREATEST_SEED = 10**9
"""Greatest seed of a campaign: times `SEEDS` of its runs it stays a seed that a scenario may have."""

TABLE, FAILURES = "chaos.csv", "failures"

COLUMNS = (
    *("run", "seed", "status", "violated", "why", "disturbances", "schedule"),
    *("passed", "trips", "since_s", "history_sha256", "links_sha256", "took_s"),
)


class ChaosFolder:
    """The folder of a campaign.

    Parameters
    ----------
    path : Path
        Where it is.
    base : ChaosBase
        The scenario.
    seed : int
        Seed of the campaign.
    command : str
        The command that makes it again.
    rows : Mapping[int, ChaosRow], optional
        Results that it has, by the number of their run (`kept_rows`); none of a new folder.
    runs : int, optional
        Number of runs that it was asked for.
    """

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
        """Results by the number of their run."""
        write_whole(path / SCENARIO, base.text)
        write_whole(path / SEED, f"{seed}\n")
        write_whole(path / ASKED, f"{runs}\n")
        open_journal(path).close()
        self.write_table()

    def add(self, row: ChaosRow) -> None:
        """Keep the result of a run, in the order in which they come."""
        with (self.path / JOURNAL).open("ab") as file:
            file.write(journal_line(row))
        self.rows[row.number] = row  # once it is kept: an error tells how many are
        with (self.path / TABLE).open("ab") as file:
            file.write(self._cells(row).encode())

    def write_table(self) -> None:
        """Write the table in the order of the runs."""
        rows = (self.rows[number] for number in sorted(self.rows))
        write_whole(self.path / TABLE, [_line(COLUMNS), *map(self._cells, rows)])

    def write_failure(self, violated: str, row: ChaosRow, simplest: ChaosRow) -> Path:
        """Write the scenario of a failure; return its file.

        Parameters
        ----------
        violated : str
            Name of the check that fails, or of what else is asked.
        row : ChaosRow
            The run in which it was found.
        simplest : ChaosRow
            The same run, or that of what its schedule was shrunk to.
        """
        file = self.path / FAILURES / f"{violated}.toml"
        file.parent.mkdir(exist_ok=True)
        seed = seed_of(self._seed, row.number)
        schedule = simplest.schedule
        fewer = len(schedule) < len(row.schedule)
        remarks = [
            f"Found by chaos: {simplest.violated.get(violated, row.violated[violated])}"[:300],
            f"{self._command}, run {row.number}, seed of the messages {seed}"
            + (f", shrunk from {len(row.schedule)} disturbances to {len(schedule)}" if fewer else ""),
            f"Once more: {again(file)}",
            *(f"  {line}" for line in schedule_lines(self._base, schedule)),
        ]
        scenario = msgspec.structs.replace(
            self._base.disturbed(schedule, seed, simplest.since_s),
            name=f"{self._base.scenario.name[:16]}-{violated}"[:31],
            title="",
        )
        scenario = with_relative_folders(scenario, file.parent)
        write_whole(file, to_toml(scenario, {}, [remark.replace("\n", " ") for remark in remarks], terse=True))
        return file

    def _cells(self, row: ChaosRow) -> str:
        cells = (
            *(row.number, seed_of(self._seed, row.number), _status(row), " ".join(sorted(row.violated))),
            "; ".join(filter(None, [*(row.violated[it] for it in sorted(row.violated)), row.collapse, row.unsettled])),
            *(len(row.schedule), json.dumps(msgspec.to_builtins(row.schedule))),
            *(" ".join(row.passed), row.trips, row.since_s, row.history_sha256, row.links_sha256, row.took_s),
        )
        return _line(cells)


def asked_of(folder: Path) -> tuple[int | None, int | None]:
    """Return the seed with which a campaign was begun, and its number of runs; None where the folder does not say."""
    runs = _number(folder / ASKED)
    return _number(folder / SEED), runs if runs is not None and runs > 0 else None


def kept_rows(folder: Path, base: ChaosBase, seed: int, driver: Driver, runs: int) -> dict[int, ChaosRow]:
    """Return the runs that a campaign has in its folder, for one that goes on there.

    Parameters
    ----------
    folder : Path
        Its folder.
    base : ChaosBase
        The scenario.
    seed, driver, runs : int, {"inprocess", "processes"}, int
        Of the campaign that goes on. Runs in one process are none of a campaign with processes.

    Raises
    ------
    FolderError
        If it is no folder of a campaign, or of one with another scenario, another seed or more runs, or is damaged.
    """
    where = f"--resume {folder}"
    for name in (SCENARIO, SEED, JOURNAL):
        if (folder / name).exists() and not (folder / name).is_file():  # to read a pipe would take for ever
            raise FolderError(f"{where}: its {name} is no file; remove it, or begin a new folder")
    try:
        text = (folder / SCENARIO).read_text(encoding="utf-8")
        theirs = int((folder / SEED).read_text(encoding="ascii"))
    except (OSError, ValueError) as error:
        raise _no_campaign(where, error) from None
    if text != base.text:
        raise FolderError(f"{where}: its {SCENARIO} is not the scenario and case to be disturbed; begin a new folder")
    if not 0 <= theirs <= GREATEST_SEED:
        raise FolderError(
            f"{where}: its {SEED} is damaged, no campaign has that seed (0 to {GREATEST_SEED}); write the one it was "
            "begun with, or begin a new folder"
        )
    if theirs != seed:
        raise FolderError(f"{where}: it was begun with --seed {theirs}, not {seed}; give that one")
    try:
        rows = rows_in(folder, ChaosRow, partial(row_problem, base))
    except OSError as error:
        raise _no_campaign(where, error) from None
    if rows and (last := max(rows)) >= runs:
        raise FolderError(f"{where}: it has run {last} already; give --runs {last + 1} or more")
    here = {SAME_IN_PROCESSES} if driver == "processes" else set()
    return {number: row for number, row in rows.items() if here <= {*row.passed, *row.violated}}


def _no_campaign(where: str, error: OSError | ValueError) -> FolderError:
    """Return the error of a folder that lacks a file of a campaign."""
    why = getattr(error, "strerror", None) or error
    return FolderError(f"{where}: no folder of a campaign: {why}; name one with {SCENARIO}, {SEED} and {JOURNAL}")


def again(file: Path) -> str:
    """Return the command that runs a failure once more."""
    return command_line("run", shown(file), "--driver", "inprocess", "--require-checks")


def _status(row: ChaosRow) -> str:
    """Return the status of a run in a word: what it violates comes before what a collapse excuses."""
    return "violated" if row.violated else "collapse" if row.collapse else "passed"


def _number(file: Path) -> int | None:
    try:
        return int(file.read_text(encoding="ascii")) if file.is_file() else None
    except (OSError, ValueError):
        return None


def _line(cells: Iterable[object]) -> str:
    text = StringIO()
    csv.writer(text, lineterminator="\n").writerow(cells)
    return text.getvalue()
