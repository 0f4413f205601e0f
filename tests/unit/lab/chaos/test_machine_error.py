"""A machine without memory, room, files or processes ends a campaign, also if a law or a child process meets it."""

from __future__ import annotations

import errno
from pathlib import Path
from typing import Any

import pytest

from gridpeers.lab.chaos import chaos_run
from gridpeers.lab.chaos.chaos_run import MachineError, machine_error
from gridpeers.scenarios.run_request import BrokenRunError
from tests.unit.lab.chaos.bases import base_in, run_scenario
from tests.unit.lab.chaos.small_campaign import SMALL

pytestmark = pytest.mark.usefixtures("elsewhere")

LACKS = "the machine lacks what a run needs"

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
    "told",
    [
        MemoryError("Unable to allocate 9 GiB"),
        OSError(errno.EAGAIN, "Resource temporarily unavailable"),
        OSError(errno.EFBIG, "File too large"),
        RuntimeError("can't start new thread"),
        "inv1 was killed by SIGKILL before t = 0.",
        "OSError: [Errno 28] No space",
        "Err(Os { code: 12, kind: OutOfMemory })",
        "ImportError: libgfortran.so.5: failed to map segment from shared object",
        "cannot open: Too many (os error 24)",
        "Zenoh cannot start its threads (Failed to init app)",
        "inv1: may have 64 files open at once, and needs 90",
    ],
)
def test_a_lack_is_known_by_its_words(told: BaseException | str) -> None:
    """Those of Python, of Rust and of the loader, in errors and in what processes leave in their logs."""
    assert str(machine_error(told)).startswith(f"{LACKS} (")


def test_a_lack_is_known_behind_the_error_that_hides_it() -> None:
    """Readers raise their own error `from None`, without the number of the system's error."""
    hiding = RuntimeError("run.mcap: cannot be read: Too many open files")
    hiding.__context__ = OSError(errno.EMFILE, "Too many open files")
    hiding.__suppress_context__ = True

    assert str(machine_error(hiding)).startswith(f"{LACKS} (OSError: [Errno {errno.EMFILE}]")


def test_words_in_the_source_of_a_program_are_no_lack() -> None:
    """A traceback quotes the lines of the program: they may name a lack that did not happen."""
    with pytest.raises(ValueError, match="too long") as raised:
        raise ValueError("too long: " + "MemoryError"[:0])

    assert machine_error(raised.value) is None


def test_another_end_of_a_process_is_a_violation(elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An error of the program is none of the machine: the check `ends` tells it."""

    def broken(*words: Any) -> Any:
        raise BrokenRunError("case IV: inv1 exited with status 1 before t = 0. Its last lines:\n    KeyError: 'inv12'")

    monkeypatch.setattr(chaos_run, "run_case", broken)

    assert "KeyError" in run_scenario(base_in(_small(elsewhere))).violated["ends"]


def test_a_law_without_memory_is_no_failed_law(elsewhere: Path) -> None:
    """The run goes on without the law, and is not judged."""
    with pytest.raises(MachineError, match=LACKS):
        run_scenario(base_in(_small(elsewhere, "raise MemoryError")))
