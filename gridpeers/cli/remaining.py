"""Show the progress of many runs together and the time left: a bar on a terminal, lines elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    Task,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text

from gridpeers.scenarios.short_texts import duration

Tell = Callable[[str, float], None]
"""Takes the present work, with its part behind a comma, and the amount of all that is done."""

MEMORY = 300.0
"""Window of a bar's estimate of the time left (s); runs differ in how long they take."""

BASIS_RUNS = 20
"""Runs before the time left is estimated: the first ones wait for workers that start, and come in bunches."""


@contextmanager
def remaining(console: Console, total: float, basis: float = 0.0) -> Iterator[Tell]:
    """Yield the function that takes the progress; its first call gives the amount that was done before.

    Parameters
    ----------
    console : Console
        Where to.
    total : float
        Amount of work, in any unit: runs, seconds simulated.
    basis : float, optional
        Amount that is done before the time left is estimated, or half of what there is to do if that is less.
    """
    pace = _Pace(total, basis)
    if not console.is_terminal:
        yield _lines(console, pace)
        return
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=30),
        TaskProgressColumn(),
        TextColumn("left"),
        _TimeLeft(),
        TextColumn("after"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=True, speed_estimate_period=MEMORY) as bars:
        task = bars.add_task("starting", total=total)
        begun = False

        def tell(what: str, done: float) -> None:
            nonlocal begun
            pace.note(done)
            if begun:
                bars.update(task, description=what, completed=done, estimated=pace.has_basis(done))
            else:
                begun = True
                bars.reset(task, description=what, completed=round(done), estimated=False)

        yield tell


class _TimeLeft(TimeRemainingColumn):
    """The time left, once there is a basis for it."""

    def render(self, task: Task) -> Text:
        """Return the estimate, or dashes."""
        return super().render(task) if task.fields.get("estimated") else Text("-:--:--", style="progress.remaining")


class _Pace:
    """How fast the work goes on from its first result.

    Parameters
    ----------
    total, basis : float
        As of `remaining`.
    """

    def __init__(self, total: float, basis: float) -> None:
        self.total, self._basis = total, basis
        self._before: float | None = None
        self._first: tuple[float, float] | None = None
        """Amount that was done with the first result, and when that came (s)."""

    def note(self, done: float) -> None:
        """Note the amount that is done."""
        if self._before is None:
            self._before = done
        elif self._first is None and done > self._before:
            self._first = done, monotonic()

    def has_basis(self, done: float) -> bool:
        """Return whether the time left can be estimated."""
        if self._before is None or self._first is None or not self._first[0] < done < self.total:
            return False
        return done - self._before >= min(self._basis, (self.total - self._before) / 2)

    def left(self, done: float) -> float | None:
        """Return the time left (s); None without a basis for it."""
        if self._first is None or not self.has_basis(done):
            return None
        amount, began = self._first
        return (monotonic() - began) / (done - amount) * (self.total - done)


def _lines(console: Console, pace: _Pace) -> Tell:
    """Print a line for each piece of work that begins, and for each tenth of all."""
    latest: tuple[str, int] | None = None

    def tell(what: str, done: float) -> None:
        nonlocal latest
        pace.note(done)
        now = what.partition(",")[0], int(10.0 * done / pace.total)
        if now == latest:
            return
        latest = now
        left = pace.left(done)
        words = f", about {duration(round(left))} left" if left is not None else ""
        text = f"{what}: {100.0 * done / pace.total:.0f} % done{words}"
        console.print(text, soft_wrap=True)

    return tell
