"""Folders of results: new ones, how far they are, and what made them."""

from __future__ import annotations

from scenarios.results.folder import RUNS, FolderError, new_folder, refusal, set_broken, set_status, shown, write_whole
from scenarios.run import versions

__all__ = [
    "RUNS",
    "FolderError",
    "new_folder",
    "refusal",
    "set_broken",
    "set_status",
    "shown",
    "versions",
    "write_whole",
]
