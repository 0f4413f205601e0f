"""A sweep from its checked plan to its folder: the runs that are not done yet, the table, the plots."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from gridpeers.scenarios.results.run_files import refusal, set_broken, set_status
from gridpeers.scenarios.sweep.file import Plan
from gridpeers.scenarios.sweep.sweep_case import run_one
from gridpeers.scenarios.sweep.sweep_folder import SweepFolder
from gridpeers.scenarios.sweep.sweep_table import as_written, results_frame, write_table
from gridpeers.scenarios.sweep.workers import on_workers


@dataclass(frozen=True, kw_only=True)
class Summary:
    """Counts and files of a sweep."""

    runs: int
    """All of its runs."""
    before: int
    """Those that were done before."""
    broke: Counter[str]
    """How many broke, by reason."""
    law_failed: Counter[str]
    """In how many a law failed, by the first reason."""
    table: Path
    """The Parquet file."""
    plots: tuple[Path, ...]
    """The figures."""


def study(plan: Plan, folder: SweepFolder, tell: Callable[[int], None], *, jobs: int, dask: str = "") -> Summary:
    """Do the runs of a sweep that are not done yet, and write its results.

    Parameters
    ----------
    plan : Plan
        The sweep.
    folder : SweepFolder
        Its folder, with the rows of runs that are done.
    tell : Callable[[int], None]
        Is called with the number of runs that are done, those from before included.
    jobs : int
        Processes on this machine; of no meaning with Dask.
    dask : str, optional
        Address of a Dask scheduler to use instead.
    """
    before = len(folder.done)
    tell(before)
    left = [(i, run.scenario, run.case) for i, run in enumerate(plan.runs) if i not in folder.done]
    try:
        if left:
            with closing(on_workers(left, min(jobs, len(left)), run_one, dask)) as results:
                for row in results:
                    folder.add(row)
                    tell(len(folder.done))
        from gridpeers.scenarios.sweep import sweep_plots  # matplotlib takes longer to import than a run

        frame = as_written(results_frame(plan, folder.done), plan)
        path = write_table(frame, plan, folder.path)
        figures = sweep_plots.draw_all(frame, folder.path / "plots")
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
        plots=figures,
    )
