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


class NoPowerFlowError(PlantError):
    """No operating point at the start.

    Attributes
    ----------
    weak : dict of int to float
        Load branches that the network cannot feed even alone, and their short-circuit powers (VA).
    """

    def __init__(self, weak: dict[int, float]) -> None:
        super().__init__("no initial operating point: the power flow did not converge")
        self.weak = weak
