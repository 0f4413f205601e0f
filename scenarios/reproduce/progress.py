"""How far the reproduction has come, and how long it still takes: a bar on a terminal, lines elsewhere."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from scenarios.reproduce.work import Tell

MEMORY = 300.0
"""Window of the estimate of the time left (s); parts differ in how long a second of them takes."""


@contextmanager
def progress(console: Console, total: float) -> Iterator[Tell]:
    """Give the function to tell what is being done and how far (s simulated)."""
    if not console.is_terminal:
        yield _lines(console, total)
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=30),
        TaskProgressColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("after"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=True, speed_estimate_period=MEMORY) as bars:
        task = bars.add_task("starting", total=total)
        yield lambda what, done: bars.update(task, description=what, completed=done)


def _lines(console: Console, total: float) -> Tell:
    began = time.monotonic()
    told = ""

    def tell(what: str, done: float) -> None:
        nonlocal told
        part = what.partition(",")[0]
        if part == told:
            return
        told = part
        left = (time.monotonic() - began) / done * (total - done) if done > 0.0 else None
        words = f", about {left:.0f} s left" if left is not None else ""
        console.print(
            f"{part}: {100.0 * done / total:.0f} % done{words}", markup=False, highlight=False, soft_wrap=True
        )

    return tell
