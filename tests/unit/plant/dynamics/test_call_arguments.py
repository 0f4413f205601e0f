"""The arguments of a compiled call as words of machine code."""

import subprocess
import sys

import numpy as np

from plant.dynamics.kernel import call_arguments
from plant.dynamics.kernel.call_arguments import pack

PEAK = """
import runpy, sys, tracemalloc
import numpy as np

pack = runpy.run_path(sys.argv[1])["pack"]
array = np.zeros(3)
pack((array,))
tracemalloc.start()
before, _ = tracemalloc.get_traced_memory()
for _ in range(45_000):
    pack((array,))
print(tracemalloc.get_traced_memory()[1] - before)
"""
"""Prints the most memory (bytes) that calls take, with numpy alone: other modules hold names that numpy forgets."""


def test_packing_an_array_leaves_no_name_in_a_table_that_is_made_anew_once_it_is_full() -> None:
    """A plant packs arrays at every step for days, and CPython's table of names must not fill by that."""
    words = [sys.executable, "-c", PEAK, call_arguments.__file__]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert int(done.stdout) < 50_000  # a new table takes 200 kB or more


def test_an_array_is_packed_with_its_address() -> None:
    """Machine code finds the numbers of an array where its words say."""
    array = np.arange(6.0).reshape(2, 3)
    _, words = pack((array,))
    assert np.frombuffer(words, np.int64).tolist() == [0, 0, 6, 8, array.__array_interface__["data"][0], 2, 3, 24, 8]
