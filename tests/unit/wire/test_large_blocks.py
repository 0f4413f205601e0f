"""Large blocks of memory come from the system and go back to it, and small ones when asked."""

from __future__ import annotations

import subprocess
import sys

import pytest

_GROWN = """
import sys
from gridpeers.wire.driver.large_blocks import LARGE, keep_out_of_the_heap

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
from gridpeers.wire.driver.large_blocks import give_back_freed

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
