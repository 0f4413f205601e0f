"""How far a run has come: a bar per case on a terminal, a line per finished case elsewhere."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from scenarios.run import Progress as Tell


@contextmanager
def progress(console: Console, cases: tuple[str, ...]) -> Iterator[Tell]:
    """Give the function to tell how far each case is.

    Parameters
    ----------
    console : Console
        Where to.
    cases : tuple[str, ...]
        Names of the cases, in the order in which they run.
    """
    if not console.is_terminal:
        yield _lines()
        return
    columns = (
        TextColumn("case {task.fields[case]:4}"),
        BarColumn(bar_width=40),
        TextColumn("{task.completed:4.1f} of {task.total:g} s simulated"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=True) as bars:
        tasks = {case: bars.add_task(case, case=case, total=0.0, start=False) for case in cases}

        def tell(case: str, t: float, end: float) -> None:
            if t == 0.0:
                bars.start_task(tasks[case])
            bars.update(tasks[case], completed=t, total=end)
            if t >= end:
                bars.stop_task(tasks[case])

        yield tell


def _lines() -> Tell:
    began: dict[str, float] = {}
    done: set[str] = set()

    def tell(case: str, t: float, end: float) -> None:
        began.setdefault(case, time.monotonic())
        if t >= end and case not in done:
            done.add(case)
            print(f"case {case}: {end:g} s simulated in {time.monotonic() - began[case]:.1f} s", flush=True)

    return tell
