"""A machine without memory, room, files or processes ends a campaign, also if a law or a child process meets it."""

from __future__ import annotations

import errno
from pathlib import Path
from threading import Event
from typing import Any

import pytest

from gridpeers.lab.chaos import campaign as campaigns
from gridpeers.lab.chaos import chaos_run
from gridpeers.lab.chaos.chaos_run import run_scenario
from gridpeers.lab.chaos.disturbance import Disturbance
from gridpeers.lab.chaos.machine_error import MachineError
from gridpeers.scenarios.drivers.children import Child
from gridpeers.scenarios.run_request import BrokenRunError
from tests.command_line import invoke
from tests.unit.lab.chaos.bases import base_in
from tests.unit.lab.chaos.small_campaign import SMALL

pytestmark = pytest.mark.usefixtures("elsewhere")

MEMORY, PROCESSES, FILES = (
    "a run has no memory",
    "a run can start no further process or thread",
    "too many files are open",
)

KILLED = "a process of a run was killed from outside, as by a system without memory"

DISK = "the files of a run cannot be written in "

LAW = '''
"""The paper's law, which fails in one agent once it has begun."""
import os, signal, sys
from gridpeers.agents.laws.consensus import Consensus


class Fails(Consensus):
    """It fails at 0.5 s."""

    def step(self, own, neighbours, T):
        if own.name == "inv4" and own.t > 0.5:
            {fault}
        return super().step(own, neighbours, T)
'''


def _small(folder: Path, fault: str = "") -> Path:
    file = folder / "small.toml"
    file.write_text(SMALL.format(extra='law = "fails:Fails"' if fault else ""), encoding="utf-8")
    if fault:
        (folder / "fails.py").write_text(LAW.format(fault=fault), encoding="utf-8")
    return file


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (MemoryError("Unable to allocate 9 GiB"), f"{MEMORY} (MemoryError: Unable to allocate 9 GiB)"),
        (OSError(errno.ENOMEM, "Cannot allocate memory"), f"{MEMORY} (Cannot allocate memory)"),
        (OSError(errno.EAGAIN, "Resource temporarily unavailable"), f"{PROCESSES} (Resource temporarily unavailable)"),
        (RuntimeError("can't start new thread"), f"{PROCESSES} (can't start new thread)"),
    ],
)
def test_a_lack_in_this_process_is_told(
    error: Exception, told: str, elsewhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without memory, or where no process can be started, the run has no verdict."""

    def lacking(*words: Any) -> Any:
        raise error

    monkeypatch.setattr(chaos_run, "run_case", lacking)
    with pytest.raises(MachineError) as raised:
        run_scenario(base_in(_small(elsewhere)))

    assert str(raised.value).startswith(told + "; ")


@pytest.mark.parametrize(
    ("program", "told"),
    [
        ("raise MemoryError", f"{MEMORY} (MemoryError)"),
        ("raise OSError(12, 'Cannot allocate memory')", f"{MEMORY} (OSError: [Errno 12] Cannot allocate memory)"),
        ("import os; os.kill(os.getpid(), 9)", f"{KILLED} (case IV: inv1 was killed by SIGKILL before t = 0."),
        ("raise OSError(11, 'No more')", f"{PROCESSES} (BlockingIOError: [Errno 11] No more)"),
        ("raise OSError(28, 'No space')", f"{DISK}{{tmp}} (OSError: [Errno 28] No space)"),
        ("raise OSError(24, 'Too many')", f"{FILES} (OSError: [Errno 24] Too many)"),
        ("raise SystemExit('Err(Os { code: 12, kind: OutOfMemory })')", f"{MEMORY} (Err(Os {{{{ code: 12, kind: "),
        (
            "raise ImportError('libgfortran.so.5: failed to map segment from shared object')",
            f"{MEMORY} (ImportError: libgfortran.so.5: failed to map segment from shared object)",
        ),
        ("raise SystemExit('cannot open: Too many (os error 24)')", f"{FILES} (cannot open: Too many (os error 24))"),
    ],
)
def test_a_lack_in_a_process_of_a_run_is_told(
    program: str, told: str, elsewhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The last lines in the log of an ended process, or its signal, tell that the machine is to blame."""
    ended = Event()
    child = Child(
        "inv1", ["-c", program], Disturbance(table="event", entry={}), elsewhere / "log", lambda it: ended.set()
    )
    assert ended.wait(60.0)
    child.release()

    def broken(*words: Any) -> Any:
        raise BrokenRunError(f"case IV: {child.report('before t = 0')}")

    monkeypatch.setattr(chaos_run, "run_case", broken)
    with pytest.raises(MachineError) as raised:
        run_scenario(base_in(_small(elsewhere)))

    assert str(raised.value).startswith(told.format(tmp=chaos_run.tempfile.gettempdir()))


def test_another_end_of_a_process_is_a_violation(elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An error of the program is none of the machine: the check `ends` tells it."""

    def broken(*words: Any) -> Any:
        raise BrokenRunError("case IV: inv1 exited with status 1 before t = 0. Its last lines:\n    KeyError: 'inv12'")

    monkeypatch.setattr(chaos_run, "run_case", broken)

    assert "KeyError" in run_scenario(base_in(_small(elsewhere))).violated["ends"]


def test_a_law_without_memory_is_no_failed_law(elsewhere: Path) -> None:
    """The run goes on without the law, and is not judged."""
    with pytest.raises(MachineError, match=MEMORY):
        run_scenario(base_in(_small(elsewhere, "raise MemoryError")))


def test_an_agent_that_the_system_kills_in_a_run_is_told(elsewhere: Path) -> None:
    """A run with processes goes on without the agent, as if it had died by itself, and is not judged."""
    with pytest.raises(MachineError, match=rf"{KILLED} \(inv4 was killed by SIGKILL after t = "):
        run_scenario(base_in(_small(elsewhere, "os.kill(os.getpid(), signal.SIGKILL)")), "processes")


def test_a_command_without_memory_ends_in_one_line(elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond the runs, as schedules are drawn: exit code 3, and what is kept."""

    def drawn(*words: Any) -> Any:
        raise MemoryError

    _small(elsewhere)
    monkeypatch.setattr(campaigns, "drawn", drawn)
    code, text = invoke("chaos", "small.toml", "--jobs", "1", "--out", "out")

    assert (code, f"{MEMORY} (MemoryError); " in text) == (3, True), text
    assert "0 of 100 runs are kept in out/" in text


def test_zenoh_without_threads_is_told(elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its panic as a session opens, in the process of the command, is one line and no verdict."""
    zenoh = pytest.importorskip("zenoh")

    class PanicException(BaseException):
        """As that of Rust is named."""

    def opened(config: Any) -> Any:
        raise PanicException("Failed to init app")

    monkeypatch.setattr(zenoh, "open", opened)
    with pytest.raises(MachineError, match=rf"{PROCESSES} \(\w+: Zenoh cannot start its threads \(Failed to init"):
        run_scenario(base_in(_small(elsewhere)), "processes")
