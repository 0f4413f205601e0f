"""The sweep file: its types, its axes, and its reading with every problem at once into a plan of runs."""

from gridpeers.scenarios.sweep.file.plan import Plan, Run
from gridpeers.scenarios.sweep.file.sweep_reading import read_sweep, sweeps

__all__ = ["Plan", "Run", "read_sweep", "sweeps"]
