"""The folder of a campaign: a line for each run in chaos.csv, and a scenario file for each kind of failure."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from io import StringIO
from pathlib import Path
from types import MappingProxyType

import msgspec

from gridpeers.lab.chaos.chaos_run import SAME_IN_PROCESSES, ChaosRow
from gridpeers.lab.chaos.disturbed_scenario import ChaosBase
from gridpeers.scenarios.results.run_files import (
    JOURNAL,
    FolderError,
    journal_line,
    open_journal,
    rows_in,
    shown,
    write_whole,
)
from gridpeers.scenarios.run_request import Driver
from gridpeers.scenarios.schema.plugin_keys import with_relative_folders
from gridpeers.scenarios.schema.scenario_writing import to_toml
from gridpeers.wire.driver.command_line import command_line

SCENARIO, ASKED = "scenario.toml", "asked.json"
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
        write_whole(path / ASKED, json.dumps({"seed": seed, "runs": runs}) + "\n")
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
        found = json.loads((folder / ASKED).read_text(encoding="utf-8"))
        return int(found["seed"]), int(found["runs"])
    except (OSError, ValueError, LookupError, TypeError) as error:
        why = error.strerror if isinstance(error, OSError) else f"its {ASKED} is damaged"
        raise FolderError(
            f"--resume {folder}: no folder of a campaign: {why}; name one with {SCENARIO} and {ASKED}"
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
