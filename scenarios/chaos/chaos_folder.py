"""The folder of a campaign: a line for each run in chaos.csv, and a scenario file for each kind of failure."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Mapping
from io import StringIO
from pathlib import Path
from types import MappingProxyType

import msgspec

from scenarios.chaos.chaos_run import ChaosRow
from scenarios.chaos.disturbance import Schedule
from scenarios.chaos.disturbed_scenario import ChaosBase
from scenarios.chaos.numbered_run import SEEDS, seed_of
from scenarios.results.run_files import FolderError, shown, write_whole
from scenarios.schema.scenario_writing import to_toml
from wire.driver.command_line import command_line

SCENARIO, TABLE, FAILURES = "scenario.toml", "chaos.csv", "failures"

PASSED = "passed"
"""Status of a run that violated nothing."""

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
    """

    def __init__(
        self,
        path: Path,
        base: ChaosBase,
        seed: int,
        command: str,
        rows: Mapping[int, ChaosRow] = MappingProxyType({}),
    ) -> None:
        self.path, self._base, self._seed, self._command = path, base, seed, command
        self.rows = dict(rows)
        """Results by the number of their run."""
        write_whole(path / SCENARIO, base.text)
        self._write_table()

    def add(self, row: ChaosRow) -> None:
        """Keep the result of a run, in the order in which they come."""
        self.rows[row.number] = row
        with (self.path / TABLE).open("a", encoding="utf-8", newline="\n") as file:
            file.write(self._cells(row))

    def sort(self) -> None:
        """Write the table in the order of the runs."""
        self._write_table()

    def _write_table(self) -> None:
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
            *(f"  {disturbance}" for disturbance in sorted(schedule, key=lambda it: it.begins_s)),
        ]
        scenario = msgspec.structs.replace(
            self._base.disturbed(schedule, seed, simplest.since_s),
            name=f"{self._base.scenario.name[:16]}-{violated}"[:31],
            title="",
        )
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


def kept_rows(folder: Path, base: ChaosBase, seed: int, runs: int) -> dict[int, ChaosRow]:
    """Return what a campaign that was interrupted, or that was to be shorter, has of one that goes on in its folder.

    Only runs that passed everything are kept: the table does not tell all that the others say, so they are done again.

    Parameters
    ----------
    folder : Path
        Its folder.
    base : ChaosBase
        The scenario.
    seed, runs : int
        Seed of the campaign that goes on, and number of its runs.

    Raises
    ------
    FolderError
        If it is no folder of a campaign, or of one with another scenario, another seed or more runs.
    """
    try:
        text = (folder / SCENARIO).read_text(encoding="utf-8")
        with (folder / TABLE).open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        why = getattr(error, "strerror", None) or error
        raise FolderError(
            f"--resume {folder}: no folder of a campaign: {why}; name one with {SCENARIO} and {TABLE}"
        ) from None
    if text != base.text:
        raise FolderError(
            f"--resume {folder}: its {SCENARIO} is not the scenario and case that are to be disturbed; "
            "begin a new folder"
        )
    kept: dict[int, ChaosRow] = {}
    for line, cells in enumerate(rows, 2):
        try:
            row = _row(cells)
            theirs = int(cells["seed"])
        except (KeyError, TypeError, ValueError) as error:
            if line == len(rows) + 1:  # a kill -9 came while it was written
                continue
            raise FolderError(f"--resume {folder}: line {line} of {TABLE} cannot be read: {error}") from None
        if theirs != seed_of(seed, row.number):
            raise FolderError(
                f"--resume {folder}: run {row.number} has seed {theirs}, with --seed {seed} it would be "
                f"{seed_of(seed, row.number)}; give the seed with which it was begun: --seed {theirs // SEEDS}"
            )
        if row.number >= runs:
            raise FolderError(
                f"--resume {folder}: it has run {row.number} already; give --runs {row.number + 1} or more"
            )
        if cells["status"] == PASSED:
            kept[row.number] = row
        else:
            kept.pop(row.number, None)
    return kept


def _row(cells: Mapping[str, str]) -> ChaosRow:
    """Return a row of the table, but for what it violated.

    Raises
    ------
    KeyError, TypeError, ValueError
        If it is none.
    """
    schedule = msgspec.convert(json.loads(cells["schedule"]), Schedule)
    return ChaosRow(
        number=int(cells["run"]),
        schedule=schedule,
        passed=tuple(cells["passed"].split()),
        history_sha256=cells["history_sha256"],
        links_sha256=cells["links_sha256"],
        trips=int(cells["trips"]),
        since_s=float(cells["since_s"]),
        took_s=float(cells["took_s"]),
    )


def again(file: Path) -> str:
    """Return the command that runs a failure once more."""
    return command_line("run", shown(file), "--driver", "inprocess", "--require-checks")


def _status(row: ChaosRow) -> str:
    """Return the status of a run in a word: what it violates comes before what a collapse excuses."""
    return "violated" if row.violated else "collapse" if row.collapse else PASSED


def _line(cells: Iterable[object]) -> str:
    text = StringIO()
    csv.writer(text, lineterminator="\n").writerow(cells)
    return text.getvalue()
