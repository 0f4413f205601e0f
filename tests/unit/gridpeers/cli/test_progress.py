"""What is told while a run, or many, are on their way."""

import io
import threading
from typing import Any

import pytest
from rich.progress import Progress, ProgressColumn, TimeRemainingColumn

from gridpeers.cli import progress, remaining
from gridpeers.scenarios.console import terminal


def test_elsewhere_than_on_a_terminal_a_finished_case_is_a_line() -> None:
    """A log has one line per case and no control characters."""
    out = io.StringIO()

    with progress.progress(terminal(file=out), ("I", "II")) as tell:
        for case in ("I", "II"):
            for t in (0.0, 0.0, 0.5, 1.0, 1.0):
                tell(case, t, 1.0)

    lines = out.getvalue().splitlines()
    assert [line.partition(" simulated in ")[0] for line in lines] == ["case I: 1 s", "case II: 1 s"]
    assert "\x1b" not in out.getvalue()


def test_on_a_terminal_bars_come_and_go() -> None:
    """The bars leave nothing behind that the report would stand below."""
    out = io.StringIO()

    with progress.progress(terminal(file=out, force_terminal=True, width=120), ("I",)) as tell:
        tell("I", 0.0, 1.0)
        tell("I", 1.0, 1.0)

    assert "case I" in out.getvalue()
    assert "\x1b[2K" in out.getvalue()


def _lines_of(monkeypatch: pytest.MonkeyPatch, basis: float, at: dict[float, tuple[str, int]]) -> list[str]:
    """Lines of 40 pieces of work: by the time (s), the present part, and how many are done."""
    out = io.StringIO()
    with remaining.remaining(terminal(file=out), 40, basis) as tell:
        for now, (part, done) in at.items():
            monkeypatch.setattr(remaining, "monotonic", lambda now=now: now)
            tell(f"{part}, {done} of 40", done)
    return out.getvalue().splitlines()


def test_many_runs_are_a_line_for_every_part_and_every_tenth(monkeypatch: pytest.MonkeyPatch) -> None:
    """The time left is reckoned from the first result on, not from what a resumed sweep finds done."""
    at = {100.0: ("a", 20), 190.0: ("a", 22), 205.0: ("a", 25), 206.0: ("b", 25), 210.0: ("b", 27), 220.0: ("b", 39)}

    assert _lines_of(monkeypatch, 0.0, at | {230.0: ("b", 40)}) == [
        "a, 20 of 40: 50 % done",
        "a, 25 of 40: 62 % done, about 75 s left",
        "b, 25 of 40: 62 % done, about 80 s left",
        "b, 39 of 40: 98 % done, about 2 s left",
        "b, 40 of 40: 100 % done",
    ]


def test_the_time_left_is_estimated_once_there_is_a_basis(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first results of workers come in bunches after a long start; half of what there is to do suffices."""
    at = {0.0: 0, 30.0: 1, 30.5: 2, 31.0: 8, 50.0: 20, 51.0: 22, 60.0: 32}

    lines = _lines_of(monkeypatch, 20.0, {now: ("a", done) for now, done in at.items()})
    of_few = _lines_of(monkeypatch, 20.0, {now: ("a", done) for now, done in {0.0: 30, 1.0: 32, 2.0: 36}.items()})

    assert [line.partition("done")[2] for line in lines] == ["", "", ", about 21 s left", ", about 8 s left"]
    assert of_few[-1] == "a, 36 of 40: 90 % done, about 1 s left"


def test_the_bar_of_many_runs_comes_and_goes() -> None:
    """It shows what is being done, how much of all is done, and leaves nothing behind."""
    out = io.StringIO()

    with remaining.remaining(terminal(file=out, force_terminal=True, width=120), 4) as tell:
        tell("topology, 1 of 4 runs", 1)
        tell("topology, 2 of 4 runs", 2)

    assert "topology, 2 of 4 runs" in out.getvalue()
    assert "50%" in out.getvalue()
    assert "\x1b[2K" in out.getvalue()


def test_the_bar_estimates_nothing_before_there_is_a_basis(monkeypatch: pytest.MonkeyPatch) -> None:
    """The time left is dashes until there are twenty results."""
    clock = 0.0
    times_left: dict[int, str] = {}

    class Bars(Progress):
        def __init__(self, *columns: ProgressColumn, **options: Any) -> None:
            super().__init__(*columns, get_time=lambda: clock, auto_refresh=False, **options)

        def update(self, *args: Any, **options: Any) -> None:
            super().update(*args, **options)
            (task,) = self.tasks
            (column,) = (it for it in self.columns if isinstance(it, TimeRemainingColumn))
            times_left[round(task.completed)] = column.render(task).plain

    monkeypatch.setattr(remaining, "Progress", Bars)
    with remaining.remaining(terminal(file=io.StringIO(), force_terminal=True), 100, 20) as tell:
        for done in range(101):
            clock += 2.0
            tell(f"chaos, {done} of 100 runs", done)

    assert times_left[2] == times_left[19] == "-:--:--"
    assert times_left[20] == "0:02:40"


def test_a_start_that_takes_long_is_explained(monkeypatch: pytest.MonkeyPatch) -> None:
    """Progress says that the first compilation takes some seconds."""
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    explained = threading.Event()

    with progress.explained(explained.set) as tell:
        tell("I", 0.0, 1.0)
        assert explained.wait(timeout=100.0)


def test_work_that_takes_long_is_explained_and_quick_work_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    """A proposal or a check that compiles says so while it does; else nothing is told, and no timer stays behind."""
    explained, too_late = threading.Event(), threading.Event()
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    with progress.explained_work(explained.set):
        assert explained.wait(timeout=100.0)
    monkeypatch.setattr(progress, "PATIENCE", 3600.0)
    before = set(threading.enumerate())
    with progress.explained_work(too_late.set):
        (timer,) = set(threading.enumerate()) - before
    timer.join(timeout=100.0)

    assert not timer.is_alive()
    assert not too_late.is_set()


def test_a_start_that_is_quick_is_not_explained(monkeypatch: pytest.MonkeyPatch) -> None:
    """The explanation is called off when time has moved."""
    monkeypatch.setattr(progress, "PATIENCE", 3600.0)
    explained = threading.Event()
    before = set(threading.enumerate())

    with progress.explained(explained.set) as tell:
        tell("I", 0.0, 1.0)
        tell("I", 0.0, 1.0)
        assert len(set(threading.enumerate()) - before) == 1  # threads of other tests may end meanwhile
        tell("I", 0.02, 1.0)

    assert not explained.is_set()
