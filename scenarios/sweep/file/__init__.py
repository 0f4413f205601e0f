"""The sweep file: its types, its axes, and its reading with every mistake at once into a plan of runs."""

from scenarios.sweep.file.plan import Plan, Run
from scenarios.sweep.file.reading import find_sweep, read_sweep, sweeps

__all__ = ["Plan", "Run", "find_sweep", "read_sweep", "sweeps"]
