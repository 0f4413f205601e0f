"""Show the progress of many runs together and the time left: a bar on a terminal, lines elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from scenarios.duration import duration

Tell = Callable[[str, float], None]
"""Takes the present work, with its part behind a comma, and the amount of all that is done."""

MEMORY = 300.0
"""Window of a bar's estimate of the time left (s); runs differ in how long they take."""


@contextmanager
def remaining(console: Console, total: float) -> Iterator[Tell]:
    """Yield the function that takes the progress; its first call gives the amount that was done before.

    Parameters
    ----------
    console : Console
        Where to.
    total : float
        Amount of work, in any unit: runs, seconds simulated.
    """
    if not console.is_terminal:
        yield _lines(console, total)
        return
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=30),
        TaskProgressColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("after"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=True, speed_estimate_period=MEMORY) as bars:
        task = bars.add_task("starting", total=total)
        begun = False

        def tell(what: str, done: float) -> None:
            nonlocal begun
            if begun:
                bars.update(task, description=what, completed=done)
            else:
                begun = True
                bars.reset(task, description=what, completed=round(done))

        yield tell


def _lines(console: Console, total: float) -> Tell:
    """Print a line for each piece of work that begins, and for each tenth of all."""
    began = before = 0.0
    latest: tuple[str, int] | None = None

    def tell(what: str, done: float) -> None:
        nonlocal began, before, latest
        now = what.partition(",")[0], int(10.0 * done / total)
        if now == latest:
            return
        if latest is None:
            began, before = monotonic(), done
        latest = now
        left = (monotonic() - began) / (done - before) * (total - done) if before < done < total else None
        words = f", about {duration(round(left))} left" if left is not None else ""
        text = f"{what}: {100.0 * done / total:.0f} % done{words}"
        console.print(text, markup=False, highlight=False, soft_wrap=True)

    return tell
