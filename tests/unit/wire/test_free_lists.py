"""Freed objects that Python keeps for new ones are given back now and then."""

from __future__ import annotations

import re
import subprocess
import sys

CODE = """
import sys
from gridpeers.wire.driver.free_lists import PERIOD, FreeLists

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
