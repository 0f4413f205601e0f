"""How the kernel schedules a process, and what memory it gives back."""

from __future__ import annotations

import os
import subprocess
import sys
import threading

import pytest

from gridpeers.wire.driver.machine import schedule_as_batch

with_policies = pytest.mark.skipif(not hasattr(os, "SCHED_BATCH"), reason="this system knows no such policy")


def policies(before: int) -> tuple[int, int]:
    """Policy of a thread that had one before, and of a thread that it starts."""
    found: list[int] = []

    def thread() -> None:
        os.sched_setscheduler(0, before, os.sched_param(0))
        schedule_as_batch()
        found.append(os.sched_getscheduler(0))
        inner = threading.Thread(target=lambda: found.append(os.sched_getscheduler(0)))
        inner.start()
        inner.join()

    outer = threading.Thread(target=thread)
    outer.start()
    outer.join()
    return found[0], found[1]


@with_policies
def test_a_thread_and_those_it_starts_become_batch_work() -> None:
    """Zenoh's threads, which start later, are scheduled as the agent that opens the session."""
    assert policies(os.SCHED_OTHER) == (os.SCHED_BATCH, os.SCHED_BATCH)


@with_policies
def test_a_policy_that_the_user_has_chosen_stays() -> None:
    """A run under `chrt --idle` stays in the background."""
    assert policies(os.SCHED_IDLE) == (os.SCHED_IDLE, os.SCHED_IDLE)


_GROWN = """
import sys
from gridpeers.wire.driver.machine import LARGE, keep_out_of_the_heap

def resident():
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) for line in file if line.startswith("RssAnon"))

if sys.argv[1] == "out":
    keep_out_of_the_heap()
first = b"1" * (200 * LARGE)
del first  # from now on glibc takes blocks of up to so many bytes from the heap
before = resident()
large, stays = b"2" * (160 * LARGE), b"3" * (LARGE // 2)
del large
print(resident() - before)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="/proc tells the size of a process")
def test_a_large_block_leaves_no_hole() -> None:
    """A block of 20 MB goes back to the system though a small one that stays was made after it."""
    words = [sys.executable, "-c", _GROWN]
    heap, out = (
        int(subprocess.run([*words, how], capture_output=True, text=True, check=True).stdout) for how in ("heap", "out")
    )

    assert out < 1000, f"{out} kB stay, and {heap} kB without"
