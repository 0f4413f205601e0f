"""Errors of the plant's numbers."""

from __future__ import annotations


class PlantError(RuntimeError):
    """The plant has no solution; the message says where, and what to try."""


class NoSolutionError(PlantError):
    """Islands of a network have no solution with the present injections.

    Attributes
    ----------
    islands : tuple of int
        Their numbers in the network's reduction.
    """

    def __init__(self, islands: tuple[int, ...]) -> None:
        super().__init__(f"{len(islands)} islands have no solution")
        self.islands = islands
