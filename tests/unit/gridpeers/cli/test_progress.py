"""What is shown while a run, or many, are on their way."""

import io
import threading

import pytest

from gridpeers.cli import progress
from gridpeers.scenarios.console import terminal


def test_a_case_that_takes_long_is_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """A log has no control characters, and nothing of quick cases."""
    out = io.StringIO()
    clock = iter((0.0, 60.0, 60.0, 61.0))
    monkeypatch.setattr(progress, "monotonic", lambda: next(clock))

    with progress.progress(terminal(file=out), ("I", "II")) as tell:
        for case in ("I", "II"):
            for t in (0.0, 0.0, 0.5, 1.0, 1.0):
                tell(case, t, 1.0)

    assert out.getvalue() == "case I: 1 s simulated in 60.0 s\n"


def test_on_a_terminal_bars_come_and_go() -> None:
    """The bars of a run and of many runs show what is done, and go with it."""
    out = io.StringIO()
    console = terminal(file=out, force_terminal=True, width=120)

    with progress.progress(console, ("I",)) as tell:
        tell("I", 0.0, 1.0)
        tell("I", 1.0, 1.0)
    with progress.remaining(console, 4) as tell_part:
        tell_part("topology, 1 of 4 runs", 1)
        tell_part("topology, 2 of 4 runs", 2)

    assert all(text in out.getvalue() for text in ("case I", "topology, 2 of 4 runs", "50%"))
    assert out.getvalue().count("\x1b[2K") > 1


def test_many_runs_are_a_line_for_every_part_and_every_tenth() -> None:
    """Where the output is no terminal."""
    out = io.StringIO()

    with progress.remaining(terminal(file=out), 40) as tell:
        for part, done in (("a", 20), ("a", 22), ("a", 25), ("b", 25), ("b", 39), ("b", 40)):
            tell(f"{part}, {done} of 40", done)

    assert out.getvalue().splitlines() == [
        "a, 20 of 40: 50 % done",
        "a, 25 of 40: 62 % done",
        "b, 25 of 40: 62 % done",
        "b, 39 of 40: 98 % done",
        "b, 40 of 40: 100 % done",
    ]


def test_work_that_takes_long_is_explained_and_quick_work_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    """The explanation is called off when time has moved, or the work has ended; no timer stays behind."""
    explained, too_late = threading.Event(), threading.Event()
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    with progress.explained(explained.set):
        assert explained.wait(timeout=100.0)
    monkeypatch.setattr(progress, "PATIENCE", 3600.0)
    for called_off in (True, False):
        before = set(threading.enumerate())
        with progress.explained(too_late.set) as call_off:
            (timer,) = set(threading.enumerate()) - before
            if called_off:
                call_off()
                timer.join(timeout=100.0)
        timer.join(timeout=100.0)
        assert not timer.is_alive()

    assert not too_late.is_set()
