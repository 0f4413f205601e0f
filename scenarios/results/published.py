"""A number that a publication prints of an experiment, at its place among our results."""

from __future__ import annotations

from dataclasses import dataclass

from scenarios.results.quantities import Quantity


@dataclass(frozen=True, kw_only=True)
class Published:
    """One number.

    Examples
    --------
    >>> place = {"case": "IV", "event": "event1", "quantity": "MPSI"}
    >>> number = Published(source="Table 1", **place, paper=0.12, digits=2, limit=0.02)
    >>> number.where, number.within(0.13), number.within(0.15)
    ('case IV, event1', True, False)
    """

    source: str
    """Where it is printed, e.g. "Table I"."""
    case: str
    """Case of our scenario."""
    event: str
    """Event of our scenario after which it is measured."""
    island: str = ""
    """First inverter of the island that it is about; "" for the whole microgrid."""
    quantity: Quantity
    paper: float
    """What the publication prints."""
    digits: int
    """Decimals that it prints."""
    limit: float | None = None
    """Largest difference that passes, in its unit; None where nothing is judged by it."""

    @property
    def where(self) -> str:
        """Place for people, e.g. "case II, event2"."""
        return f"case {self.case}, {self.event}" + (f", island of {self.island}" if self.island else "")

    def within(self, ours: float) -> bool | None:
        """Whether our number is near enough; None where the number is not judged.

        Both count at the precision of the computation: a printed 0.14 stands for exactly 0.14.
        """
        return None if self.limit is None else abs(ours - self.paper) <= self.limit
