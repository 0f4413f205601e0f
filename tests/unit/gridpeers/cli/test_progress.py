"""What is told while a run, or many, are on their way."""

import io
import threading

import pytest
from rich.console import Console

from gridpeers.cli import progress, remaining


def test_elsewhere_than_on_a_terminal_a_finished_case_is_a_line() -> None:
    """A log has one line per case and no control characters."""
    out = io.StringIO()

    with progress.progress(Console(file=out), ("I", "II")) as tell:
        for case in ("I", "II"):
            for t in (0.0, 0.0, 0.5, 1.0, 1.0):
                tell(case, t, 1.0)

    lines = out.getvalue().splitlines()
    assert [line.partition(" simulated in ")[0] for line in lines] == ["case I: 1 s", "case II: 1 s"]
    assert "\x1b" not in out.getvalue()


def test_on_a_terminal_bars_come_and_go() -> None:
    """The bars leave nothing behind that the report would stand below."""
    out = io.StringIO()

    with progress.progress(Console(file=out, force_terminal=True, width=120), ("I",)) as tell:
        tell("I", 0.0, 1.0)
        tell("I", 1.0, 1.0)

    assert "case I" in out.getvalue()
    assert "\x1b[2K" in out.getvalue()


def test_many_runs_are_a_line_for_every_part_and_every_tenth(monkeypatch: pytest.MonkeyPatch) -> None:
    """The time left is reckoned from what was done since the start, not from what a resumed sweep finds done."""
    clock = iter([100.0, 100.0, 110.0, 240.0, 300.0])
    monkeypatch.setattr(remaining, "monotonic", lambda: next(clock))
    out = io.StringIO()

    with remaining.remaining(Console(file=out), 40) as tell:
        for part, done in (("a", 20), ("a", 22), ("a", 25), ("b", 25), ("b", 27), ("b", 39), ("b", 40)):
            tell(f"{part}, {done} of 40", done)

    assert out.getvalue().splitlines() == [
        "a, 20 of 40: 50 % done",
        "a, 25 of 40: 62 % done, about 0 s left",
        "b, 25 of 40: 62 % done, about 30 s left",
        "b, 39 of 40: 98 % done, about 7 s left",
        "b, 40 of 40: 100 % done",
    ]


def test_the_bar_of_many_runs_comes_and_goes() -> None:
    """It shows what is being done, how much of all is done, and leaves nothing behind."""
    out = io.StringIO()

    with remaining.remaining(Console(file=out, force_terminal=True, width=120), 4) as tell:
        tell("topology, 1 of 4 runs", 1)
        tell("topology, 2 of 4 runs", 2)

    assert "topology, 2 of 4 runs" in out.getvalue()
    assert "50%" in out.getvalue()
    assert "\x1b[2K" in out.getvalue()


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
