"""Delays between two bounds, all alike."""

from __future__ import annotations

from typing import Annotated

from netem.models.delay.delay_model import DELAY, RandomDelay
from wire.plausible import Unit
from wire.table_schema import Problem


class Uniform(RandomDelay, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="model", tag="uniform"):
    """Delay uniform on (low, high): F^-1(u) = low + u (high - low)."""

    low_s: Annotated[float, Unit("s"), DELAY]
    """Shortest delay (s)."""
    high_s: Annotated[float, Unit("s"), DELAY]
    """Longest delay (s)."""

    def quantile(self, u: float) -> float:
        """Delay (s) at share u."""
        return self.low_s + u * (self.high_s - self.low_s)

    def cdf(self, delay_s: float) -> float:
        """Share up to a delay (s)."""
        return min(max((delay_s - self.low_s) / (self.high_s - self.low_s), 0.0), 1.0)

    def relations(self) -> list[Problem]:
        """Return what its values ask of each other."""
        found = []
        if self.low_s >= self.high_s:
            text = f"{self.low_s:g} s must be below high_s = {self.high_s:g} s; swap them, or write one constant delay"
            found.append(Problem("low_s", text))
        return found
