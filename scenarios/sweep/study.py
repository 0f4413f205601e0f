"""A sweep from its checked plan to its folder: the runs that are not done yet, and the table of all."""

from __future__ import annotations

import contextlib
import json
import os
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from gridpeers.scenarios.results.run_files import (
    JOURNAL,
    LOCK,
    RUNS,
    FolderError,
    journal_line,
    locked,
    open_journal,
    refusal,
    rows_in,
    set_broken,
    set_status,
    shown,
    write_whole,
)
from gridpeers.scenarios.schema.scenario_writing import to_toml
from gridpeers.scenarios.sweep.sweep_case import FATE, SweepRow, run_one
from gridpeers.scenarios.sweep.sweep_reading import Plan
from gridpeers.scenarios.sweep.workers import on_workers
from gridpeers.scenarios.versions import versions

MANIFEST = "sweep.json"


def folder_of(out: Path | None, name: str) -> Path:
    return RUNS / "sweeps" / name if out is None else out


class SweepFolder:
    """The folder of one sweep, locked while it is open: new, empty, or this sweep's from before; else FolderError."""

    def __init__(self, folder: Path, plan: Plan) -> None:
        self.path, self._size = folder, len(plan.runs)
        self.done: dict[int, SweepRow] = {}
        whole = {"name": plan.name, "runs": len(plan.runs), "fingerprint": plan.fingerprint} | versions()
        del whole["eclipse-zenoh"]  # it has no part in a run in one process
        try:
            _check(folder, whole)
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = locked(folder, "--out", "sweep")
            try:
                if not _check(folder, whole):  # once more: another sweep may have begun there before the lock
                    write_whole(folder / "sweep.toml", plan.text)
                    write_whole(folder / "scenario.toml", to_toml(plan.base, {"driver": "inprocess"} | versions()))
                    write_whole(folder / MANIFEST, json.dumps(whole, indent=2) + "\n")
                self.done = self._kept_rows()
                set_status(folder, "running")
                self._journal = open_journal(folder)
            except BaseException:
                os.close(self._lock)
                raise
        except OSError as error:
            raise FolderError(
                f"{folder}: cannot be created or written: {error.strerror}; give another folder by --out"
            ) from None

    def __enter__(self) -> SweepFolder:
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(OSError):  # a run that found no room; those that are kept are on the disk already
            self._journal.close()
        os.close(self._lock)

    @property
    def kept(self) -> int:
        """Number of finished runs that will be found again."""
        return len(self._kept_rows())

    def add(self, done: SweepRow) -> None:
        self._journal.write(journal_line(done))
        self._journal.flush()
        os.fsync(self._journal.fileno())
        self.done[done.number] = done

    def _kept_rows(self) -> dict[int, SweepRow]:
        return rows_in(self.path, SweepRow, self._size) if (self.path / JOURNAL).exists() else {}


def _check(folder: Path, whole: Mapping[str, object]) -> bool:
    """Return True if the folder is this sweep's from before; FolderError if it is something else's."""
    where = f"--out {shown(folder)}"
    if folder.exists() and not folder.is_dir():
        raise FolderError(f"{where}: this is a file; give a folder")
    manifest = folder / MANIFEST
    if not manifest.is_file():
        known = (LOCK, "sweep.toml", "scenario.toml")
        rest = [path.name for path in folder.iterdir() if path.name not in known] if folder.is_dir() else []
        if any(not name.endswith(".partial") for name in rest):
            raise FolderError(f"{where}: it holds other files ({min(rest)}); give a new folder, or that of a sweep")
        return False
    try:
        found = json.loads(manifest.read_text(encoding="utf-8"))
        other = [f"{key} is {found.get(key)}, not {now}" for key, now in whole.items() if found.get(key) != now]
    except (ValueError, AttributeError):
        raise FolderError(f"{where}: its {MANIFEST} cannot be read; give another folder by --out") from None
    if other:
        raise FolderError(
            f"{where}: holds another sweep, or this one with another file, scenario, feeder or version: "
            f"{'; '.join(other)}; give another folder by --out, or remove this one"
        )
    return True


FILE = "results.csv"


def results_frame(plan: Plan, done: Mapping[int, SweepRow]) -> pd.DataFrame:
    """Return the rows of the runs that are done.

    Columns: `sample`, `case`, `seed`, the parameters by their path, those of `FATE` (`metric_warnings` only where the
    scenario has metrics of its own), the indexes as "WINDOW.INDEX", nan where there is no value, and over emulated
    links `links_sent`, `links_delivered`, `links_dropped`.
    """
    numbers = sorted(done)
    runs, rows = [plan.runs[number] for number in numbers], [done[number] for number in numbers]
    columns: dict[str, list[object]] = {
        "sample": [run.sample for run in runs],
        "case": [run.case for run in runs],
        "seed": [run.scenario.seed for run in runs],
    }
    columns |= {name: [run.shown[name] for run in runs] for name in plan.parameters if name not in columns}
    fate = FATE if any(run.scenario.metrics for run in runs) else FATE[:-1]
    columns |= {name: [getattr(row, name) or None for row in rows] for name in fate}
    measures = pd.DataFrame([row.measures for row in rows], dtype=float)
    return pd.concat([pd.DataFrame(columns), measures], axis=1)


def write_table(frame: pd.DataFrame, plan: Plan, folder: Path) -> Path:
    """Write a table at once or not at all; a parameter whose values are no numbers alone is JSON."""
    mixed = [name for name in plan.parameters if frame[name].dtype == object]
    written = frame.assign(**{name: [json.dumps(value, default=str) for value in frame[name]] for name in mixed})
    write_whole(folder / FILE, written.to_csv(index=False))
    return folder / FILE


@dataclass(frozen=True, kw_only=True)
class Summary:
    runs: int
    before: int
    broke: Counter[str]
    """How many broke, by reason."""
    law_failed: Counter[str]
    """In how many a law failed, by the first reason."""
    table: Path


def study(plan: Plan, folder: SweepFolder, tell: Callable[[int], None], *, jobs: int) -> Summary:
    """Do the runs of a sweep that are not done yet, and write its results; `tell` hears how many are done by now."""
    before = len(folder.done)
    tell(before)
    left = [(i, run.scenario, run.case) for i, run in enumerate(plan.runs) if i not in folder.done]
    try:
        if left:
            with closing(on_workers(left, min(jobs, len(left)), run_one)) as results:
                for row in results:
                    folder.add(row)
                    tell(len(folder.done))
        path = write_table(results_frame(plan, folder.done), plan, folder.path)
        set_status(folder.path, "complete")
    except BaseException as error:
        why = refusal(folder.path, error) if isinstance(error, OSError) else str(error)
        why = "interrupted" if isinstance(error, KeyboardInterrupt) else why
        set_broken(folder.path, f"{why} after {folder.kept} of {len(plan.runs)} runs")
        raise
    rows = folder.done.values()
    return Summary(
        runs=len(plan.runs),
        before=before,
        broke=Counter(row.why for row in rows if row.status == "broke"),
        law_failed=Counter(row.why for row in rows if row.status == "law failed"),
        table=path,
    )
