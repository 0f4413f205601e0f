"""How fast the clock of a run may go; apart from all that a run imports, because commands check it first."""

SPEEDS = (0.1, 50.0)
"""Least and greatest useful speed (s of run time per s of wall time), of a live run or of a scenario."""
