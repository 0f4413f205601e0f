"""Sweeps that are written in a file (docs/sweeps.md); `gridpeers.sweep` is for those that are written in Python."""

from __future__ import annotations

from gridpeers.scenarios.catalogue_files import SWEEPS
from gridpeers.scenarios.schema.loading import read_toml
from gridpeers.scenarios.sweep.sweep_reading import Plan, read_sweep

__all__ = ["Plan", "read_sweep", "sweep_title"]


def sweep_title(name: str) -> str:
    """Return the title of a sweep of the catalogue, without checking its runs.

    Examples
    --------
    >>> sweep_title("gains")
    'Gains k_p and k_q of the secondary law'
    """
    return str(read_toml(SWEEPS / f"{name}.toml")[1]["title"])
