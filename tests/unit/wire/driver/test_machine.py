"""How the kernel schedules a process, and what memory it gives back."""

from __future__ import annotations

import os
import re
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


_FREED = """
from gridpeers.wire.driver.machine import give_back_freed

def resident():
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) for line in file if line.startswith("RssAnon"))

before = resident()
blocks = [b"1" * 60_000 for _ in range(500)]
stays = blocks[-1]
del blocks
grown = resident() - before
give_back_freed()
print(grown, resident() - before)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="/proc tells the size of a process")
def test_what_is_free_below_a_block_that_stays_is_given_back() -> None:
    """30 MB of the heap are free below a small block, and go back to the system only when asked."""
    done = subprocess.run([sys.executable, "-c", _FREED], capture_output=True, text=True, check=True)

    grown, left = (int(number) for number in done.stdout.split())
    assert grown > 25_000
    assert left < 2_000, f"{left} of {grown} kB stay"


CODE = """
import sys
from gridpeers.wire.driver.machine import PERIOD, FreeLists

def tuples():
    sys.stderr.flush()
    sys._debugmallocstats()

lists = FreeLists(100.0)
many = [tuple([k] * 19) for k in range(3000)]
del many
tuples()
print([lists.tend(100.0 + at) for at in (0.0, PERIOD - 1.0)])
tuples()
print([lists.tend(100.0 + at) for at in (PERIOD, PERIOD + 1.0, 2.0 * PERIOD)])
tuples()
"""


def test_tuples_that_are_free_are_given_back_once_a_period() -> None:
    """Not before, and again after that; Python keeps 2000 of each length until then."""
    done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=True)

    free = [int(number) for number in re.findall(r"(\d+) free 19-sized PyTupleObjects", done.stderr)]
    assert done.stdout.splitlines() == ["[False, False]", "[True, False, True]"]
    assert free[0] == free[1] == 2000
    assert free[2] < 10
