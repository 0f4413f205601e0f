"""Show the progress of a run: a bar per case on a terminal, a line per finished case elsewhere."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from gridpeers.scenarios.run_request import Progress as Tell

PATIENCE = 4.0
"""A start that takes longer than this (s) is explained; usually it takes about 1 s."""

COMPILING = (
    "still starting: the plant is built, and the first run ever compiles its inner loop, which takes some seconds ..."
)

TRYING = (
    "still at work: the plant is tried; the first use ever compiles its inner loop, which takes some 20 seconds ..."
)

RESTING = (
    "still starting: GridLAB-D solves the feeder and comes to rest before t = 0; the first run ever compiles our "
    "operating point before that, which takes some 10 seconds ..."
)


@contextmanager
def progress(console: Console, cases: tuple[str, ...], explanation: str = COMPILING) -> Iterator[Tell]:
    """Yield the function that takes the progress of each case; its first call for a case, at t = 0, is the start.

    Parameters
    ----------
    console : Console
        Where to.
    cases : tuple[str, ...]
        Names of the cases, in the order in which they run.
    explanation : str, optional
        Why a start may take long.
    """
    with explained(lambda: console.print(explanation, soft_wrap=True)) as started:
        if console.is_terminal:
            with _bars(console, cases) as tell:
                yield _both(started, tell)
        else:
            yield _both(started, _lines(console))


@contextmanager
def explained(explain: Callable[[], None]) -> Iterator[Tell]:
    """Explain a start that takes long; it ends when time moves, as the plant's first step is compiled last."""
    timer = threading.Timer(PATIENCE, explain)
    timer.daemon = True
    begun = False

    def tell(case: str, t: float, end: float) -> None:
        nonlocal begun
        if not begun:
            begun = True
            timer.start()
        elif t > 0.0:
            timer.cancel()

    try:
        yield tell
    finally:
        timer.cancel()


@contextmanager
def explained_work(explain: Callable[[], None]) -> Iterator[None]:
    """Explain the work within the context if it takes long."""
    with explained(explain) as tell:
        tell("", 0.0, 1.0)
        yield


@contextmanager
def _bars(console: Console, cases: tuple[str, ...]) -> Iterator[Tell]:
    columns = (
        TextColumn("case {task.fields[case]:4}", markup=False),
        BarColumn(bar_width=40),
        TextColumn("{task.completed:4.1f} of {task.total:g} s simulated"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=True) as bars:
        tasks = {case: bars.add_task(case, case=case, total=1.0, start=False, visible=False) for case in cases}

        def tell(case: str, t: float, end: float) -> None:
            if t == 0.0:
                bars.start_task(tasks[case])
            bars.update(tasks[case], completed=t, total=end, visible=True)

        yield tell


def _lines(console: Console) -> Tell:
    began: dict[str, float] = {}
    done: set[str] = set()

    def tell(case: str, t: float, end: float) -> None:
        began.setdefault(case, time.monotonic())
        if t >= end and case not in done:
            done.add(case)
            took = time.monotonic() - began[case]
            console.print(f"case {case}: {end:g} s simulated in {took:.1f} s")

    return tell


def _both(first: Tell, second: Tell) -> Tell:
    def tell(case: str, t: float, end: float) -> None:
        first(case, t, end)
        second(case, t, end)

    return tell
