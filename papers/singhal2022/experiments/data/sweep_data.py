"""The rows of a sweep that an experiment draws from, and what theory says of each."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np

from gridpeers.measures import Floats
from gridpeers.theory import (
    Feeder,
    Fleet,
    LoadStep,
    Sensitivity,
    Spec,
    VarResponse,
    feeder_of,
    first_window,
    fleet_of,
    load_steps,
    sensitivity,
    var_response,
)

Row = Mapping[str, Any]
"""Columns of one run."""

_ALL: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True, kw_only=True)
class SweepData:
    """A sweep that is done.

    Examples
    --------
    >>> rows = [{"case": "a", "link[0].delay": d, "e.t_f_s": t} for d, t in ((0.1, 2.0), (0.0, 1.0), (0.2, None))]
    >>> swept = SweepData(rows=rows, base=None, window="e")
    >>> swept.curve("link[0].delay", "t_f_s", {"case": "a"})
    (array([0. , 0.1, 0.2]), array([ 1.,  2., inf]))
    """

    rows: Sequence[Row]
    """All runs, in the order of the sweep."""
    base: Spec
    """The scenario that was varied."""
    window: str
    """Label of the event that is measured."""
    _fleets: dict[str, Fleet] = field(default_factory=dict)

    def where(self, equal: Mapping[str, Any] = _ALL) -> Iterator[Row]:
        """Rows whose columns have these values."""
        return (row for row in self.rows if all(row[name] == value for name, value in equal.items()))

    def values(self, column: str, equal: Mapping[str, Any] = _ALL) -> list[Any]:
        """Different values of a column, sorted."""
        return sorted({row[column] for row in self.where(equal)})

    def measure(self, row: Row, index: str) -> float:
        """An index of a row: infinite for a time that never came, not a number where a run broke."""
        value = row[f"{self.window}.{index}"]
        if value is not None:
            return float(value)
        return np.inf if index.startswith("t_") and row.get("status") != "broke" else np.nan

    def median(self, index: str, equal: Mapping[str, Any]) -> float:
        """Median of an index over the rows whose columns have these values."""
        return float(np.median([self.measure(row, index) for row in self.where(equal)]))

    def curve(
        self, x: str, index: str, equal: Mapping[str, Any], over: Callable[[Floats], Any] = np.median
    ) -> tuple[Floats, Floats]:
        """An index against a column, by default the median over all other columns."""
        at = self.values(x, equal)
        found = [
            float(over(np.array([self.measure(row, index) for row in self.where({**equal, x: value})]))) for value in at
        ]
        return np.array(at, float), np.array(found)

    # ---------------------------------------------------------------- what theory needs

    @cached_property
    def feeder(self) -> Feeder:
        """The feeder."""
        return feeder_of(self.base)

    @cached_property
    def calm(self) -> Spec:
        """The scenario with links that do nothing, its first event alone, and an end before long."""
        return first_window(self.base, 3.0)

    @cached_property
    def load(self) -> LoadStep:
        """The step of load of the event, from the plant on droop alone."""
        (step,) = (step for step in load_steps(self.calm, self.feeder) if step.label == self.window)
        assert step.load is not None
        return step.load

    @cached_property
    def answers(self) -> Sensitivity:
        """How voltages and vars answer to V_set."""
        return sensitivity(self.calm, self.feeder)

    @cached_property
    def response(self) -> VarResponse:
        """The same with the plant's lags."""
        return var_response(self.calm, self.feeder)

    def fleet(self, case: str) -> Fleet:
        """The inverters under the rule of a case."""
        if case not in self._fleets:
            self._fleets[case] = fleet_of(self.base, self.feeder, case)
        return self._fleets[case]
