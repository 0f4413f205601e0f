"""The one error of the plant's numbers."""

from __future__ import annotations


class PlantError(RuntimeError):
    """The plant has no solution: the message says where, and what to try."""
