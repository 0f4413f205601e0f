"""Show the progress of a run, or of many runs together: bars on a terminal, few lines elsewhere."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

if TYPE_CHECKING:
    from gridpeers.scenarios.run_request import Progress as TellCase

TellPart = Callable[[str, float], None]
"""Takes the present work, with its part behind a comma, and the amount of all that is done."""

PATIENCE = 4.0  # A start that takes longer than this (s) is explained; usually it takes about 1 s

COMPILING = "starting ... (only the first run compiles the plant, which takes about 20 s)"
TRYING = "checking the start of the plant ... (only the very first use compiles it, which takes about 20 s)"

LONG = 30.0  # A case that takes longer than this (s) has a line in a log; so the output of most runs fits one screen
MEMORY = 300.0  # Window of a bar's estimate of the time left (s); runs differ in how long they take


@contextmanager
def explained(explain: Callable[[], None]) -> Iterator[Callable[[], None]]:
    """Explain the work within the context if it takes long; yield the function that calls the explanation off."""
    timer = threading.Timer(PATIENCE, explain)
    timer.daemon = True
    timer.start()
    try:
        yield timer.cancel
    finally:
        timer.cancel()


@contextmanager
def progress(console: Console, cases: tuple[str, ...], explanation: str = COMPILING) -> Iterator[TellCase]:
    """Yield the function that takes the progress of each case; an `explanation` comes if t = 0 lasts long."""
    began: dict[str, float] = {}
    left = set(cases)
    with explained(lambda: console.print(explanation, soft_wrap=True)) as begun, _bars(console) as bars:
        bar = bars.add_task("", start=False, visible=False)

        def tell(case: str, t: float, end: float) -> None:
            if t > 0.0:  # the plant's first step is compiled last
                begun()
            if case not in began:
                began[case] = monotonic()
                bars.reset(bar, total=end, description=f"case {case}", visible=True)
            bars.update(bar, completed=t)
            if t >= end and case in left:
                left.remove(case)
                if not console.is_terminal and (took := monotonic() - began[case]) > LONG:
                    console.print(f"case {case}: {end:g} s simulated in {took:.1f} s")

        yield tell


@contextmanager
def remaining(console: Console, total: float) -> Iterator[TellPart]:
    """Yield the function that takes the progress of a total in any unit: runs, seconds simulated.

    Its first call gives the amount that was done before; the time left counts from it. Where the output is no terminal,
    there is a line for each piece of work that begins, and for each tenth of all.
    """
    shown: set[tuple[str, int]] = set()
    with _bars(console) as bars:
        bar = bars.add_task("starting", total=total, start=False)

        def tell(what: str, done: float) -> None:
            if not bars.tasks[0].started:
                bars.reset(bar, total=total, completed=round(done))
            bars.update(bar, description=what, completed=done)
            now = what.partition(",")[0], int(10.0 * done / total)
            if not console.is_terminal and now not in shown:
                shown.add(now)
                console.print(f"{what}: {100.0 * done / total:.0f} % done", soft_wrap=True)

        yield tell


def _bars(console: Console) -> Progress:
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=30),
        TaskProgressColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("after"),
        TimeElapsedColumn(),
    )
    hidden = not console.is_terminal
    return Progress(*columns, console=console, transient=True, disable=hidden, speed_estimate_period=MEMORY)
