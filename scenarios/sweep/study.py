"""A sweep from its checked plan to its folder: the runs that are not done yet, the table, the plots."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from scenarios.results.run_files import refusal, set_broken, set_status
from scenarios.sweep.file import Plan
from scenarios.sweep.sweep_folder import SweepFolder
from scenarios.sweep.sweep_table import table_of, write_table
from scenarios.sweep.workers import on_dask, on_this_machine

TellRuns = Callable[[int], None]
"""Told how many runs are done, those from before included."""


@dataclass(frozen=True, kw_only=True)
class Summary:
    """What a sweep came to."""

    runs: int
    """All of its runs."""
    before: int
    """Those that were done before."""
    broke: Counter[str]
    """How many broke, by reason."""
    table: Path
    """The Parquet file."""
    plots: tuple[Path, ...]
    """The figures."""


def study(plan: Plan, folder: SweepFolder, tell: TellRuns, *, jobs: int, dask: str = "") -> Summary:
    """Do what is left of a sweep and write its results.

    Parameters
    ----------
    plan : Plan
        The sweep.
    folder : SweepFolder
        Its folder, with what is done already.
    tell : Callable[[int], None]
        Told of progress.
    jobs : int
        Processes on this machine; of no meaning with Dask.
    dask : str, optional
        Address of a Dask scheduler to use instead.
    """
    try:
        return _study(plan, folder, tell, jobs, dask)
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            why = "interrupted"
        else:
            why = refusal(folder.path, error) if isinstance(error, OSError) else str(error)
        set_broken(folder.path, f"{why} after {folder.kept} of {len(plan.runs)} runs")
        raise


def _study(plan: Plan, folder: SweepFolder, tell: TellRuns, jobs: int, dask: str) -> Summary:
    before = len(folder.done)
    tell(before)
    left = [(number, run) for number, run in enumerate(plan.runs) if number not in folder.done]
    if left:
        with closing(on_dask(left, dask) if dask else on_this_machine(left, min(jobs, len(left)))) as results:
            for done in results:
                folder.add(done)
                tell(len(folder.done))
    table = table_of(plan, folder.done)
    path = write_table(table, folder.path)

    from scenarios.sweep import (
        sweep_plots as plots,  # matplotlib takes longer to import than a run; nothing else waits for it
    )

    figures = plots.draw_all(table, folder.path / "plots")
    set_status(folder.path, "complete")
    return Summary(
        runs=len(plan.runs),
        before=before,
        broke=Counter(done.why for done in folder.done.values() if done.status == "broke"),
        table=path,
        plots=figures,
    )
