"""A process ends once however often it is asked, writes its output to the end, and waits for no thread."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest

from gridpeers.wire.driver import ending
from gridpeers.wire.driver.command_line import command_line
from gridpeers.wire.driver.drive import StoppedError
from gridpeers.wire.driver.ending import SAME_REQUEST_TIME
from gridpeers.wire.driver.machine import schedule_as_batch


@pytest.mark.parametrize("ignored", [False, True])
def test_signals_end_a_process_once_for_each_request(ignored: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """SIGINT is KeyboardInterrupt with its name, and one that a shell has ignored stays so.

    `timeout` signals a command and its group: the end of a run is not interrupted by that; a later signal counts.
    """
    times = [10.0, 10.0, 10.0 + 0.9 * SAME_REQUEST_TIME, 10.0 + SAME_REQUEST_TIME]
    monkeypatch.setattr(ending, "monotonic", lambda: times.pop(0))
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        signal.signal(signal.SIGINT, signal.SIG_IGN if ignored else signal.default_int_handler)
        ending.stop_at_signals(StoppedError)
        stop: Any = signal.getsignal(signal.SIGTERM)

        assert signal.getsignal(signal.SIGINT) is (signal.SIG_IGN if ignored else stop)
        with pytest.raises(KeyboardInterrupt, match="SIGINT"):
            stop(signal.SIGINT, None)
        stop(signal.SIGTERM, None)
        stop(signal.SIGTERM, None)
        with pytest.raises(StoppedError, match="SIGTERM"):
            stop(signal.SIGTERM, None)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def test_a_thread_that_never_ends_does_not_hold_up_the_end() -> None:
    """The work of the end is done, and the exit status is that of the process."""
    script = """
import atexit, threading
from gridpeers.wire.driver.ending import leave
threading.Thread(target=threading.Event().wait).start()
atexit.register(print, "done")
leave(3)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=30.0)

    assert (done.returncode, done.stdout.strip()) == (3, "done")


def test_a_program_that_is_not_found_by_its_name_has_its_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without an active environment; with one nobody types a path, and from Python a command has its name."""
    for name in ("gridpeers", "pytest"):
        (tmp_path / name).write_text("#!/bin/sh\n")
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", "/usr/bin:/bin")
    monkeypatch.chdir(tmp_path)
    for called in ("./gridpeers", str(tmp_path / "gridpeers")):
        monkeypatch.setattr(sys, "argv", [called])
        assert command_line("run", "a b") == f"{tmp_path}/gridpeers run 'a b'"
        assert command_line(program="pytest") == f"{tmp_path}/pytest"
    monkeypatch.setenv("PATH", str(tmp_path))
    assert command_line("run", "a b") == "gridpeers run 'a b'"
    monkeypatch.setattr(sys, "argv", ["/somewhere/notebook.py"])
    assert command_line("down") == "gridpeers down"


@pytest.mark.skipif(not hasattr(os, "SCHED_BATCH"), reason="this system knows no such policy")
@pytest.mark.parametrize(("before", "after"), [("SCHED_OTHER", "SCHED_BATCH"), ("SCHED_IDLE", "SCHED_IDLE")])
def test_a_thread_and_those_it_starts_become_batch_work(before: str, after: str) -> None:
    """Zenoh's threads start later; a policy that the user has chosen, such as by `chrt --idle`, stays."""
    found: list[int] = []

    def thread() -> None:
        os.sched_setscheduler(0, getattr(os, before), os.sched_param(0))
        schedule_as_batch()
        inner = threading.Thread(target=lambda: found.append(os.sched_getscheduler(0)))
        inner.start()
        inner.join()

    outer = threading.Thread(target=thread)
    outer.start()
    outer.join()

    assert found == [getattr(os, after)]
