"""How far a sweep has come: a bar with the time left on a terminal, a line every tenth elsewhere."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from scenarios.sweep.file.plan import duration
from scenarios.sweep.study import Tell

MEMORY = 120.0
"""Window of the estimate of the time left (s)."""


@contextmanager
def progress(console: Console, runs: int) -> Iterator[Tell]:
    """Give the function to tell how many runs are done; its first call says how many were done before."""
    if not console.is_terminal:
        yield _lines(console, runs)
        return
    columns = (
        BarColumn(bar_width=40),
        MofNCompleteColumn(),
        TextColumn("runs, left"),
        TimeRemainingColumn(),
        TextColumn("of"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=True, speed_estimate_period=MEMORY) as bars:
        task = bars.add_task("", total=runs, start=False)
        begun = False

        def tell(done: int) -> None:
            nonlocal begun
            if begun:
                bars.update(task, completed=done)
            else:
                begun = True
                bars.reset(task, completed=done)

        yield tell


def _lines(console: Console, runs: int) -> Tell:
    began = time.monotonic()
    first = -1
    told = 0

    def tell(done: int) -> None:
        nonlocal first, told
        if first < 0:
            first = done
            told = 10 * done // runs
        elif 10 * done // runs > told:
            told = 10 * done // runs
            left = (time.monotonic() - began) / (done - first) * (runs - done)
            console.print(f"{done} of {runs} runs, {duration(left)} left", markup=False, highlight=False)

    return tell
