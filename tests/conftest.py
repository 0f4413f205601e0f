"""What all tests need of their surroundings."""

from __future__ import annotations

import fcntl
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

# A shell that runs its tests in the background, or nohup, has Ctrl-C ignored, and every process that a test starts
# would inherit that; but what Ctrl-C does is what some of them are about.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

REAL_TIME = ("processes", "schedules", "netem_relay")
"""Folders of tests that keep real time: each has the machine to itself, also where `pytest -n` runs several at once."""


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.hookimpl(wrapper=True, tryfirst=True)  # outside the time limit of a test, which must not count this wait
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Let a test that keeps real time wait until it is alone, and all others until it is over."""
    if not hasattr(item.config, "workerinput"):  # one process runs all tests
        return (yield)
    tests = Path(__file__).parent
    alone = any(item.path.is_relative_to(tests / folder) for folder in REAL_TIME)  # doctests stand elsewhere
    folders: pytest.TempPathFactory = item.config._tmp_path_factory  # type: ignore[attr-defined]
    with (folders.getbasetemp().parent / "real-time.lock").open("w") as lock:  # the workers' folders stand side by side
        fcntl.flock(lock, fcntl.LOCK_EX if alone else fcntl.LOCK_SH)
        return (yield)
