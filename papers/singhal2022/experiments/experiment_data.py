"""The results that an experiment draws from, cases with histories or rows of a sweep, and the theory's predictions."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np

from gridpeers.measures import (
    MPSI,
    MQSI,
    STEADY,
    Floats,
    History,
    Nameplates,
    Settling,
    Window,
    mean_frequency,
    nameplates_of,
    settling,
)
from gridpeers.theory import (
    Feeder,
    InverterGroup,
    LoadStep,
    ScenarioModel,
    VarResponse,
    feeder_of,
    first_window,
    inverter_group_of,
    load_steps,
    var_response,
    without_faults,
)


@dataclass(frozen=True, kw_only=True)
class CaseData:
    """A scenario that was run."""

    scenario: ScenarioModel
    feeder: Feeder
    histories: Mapping[str, History]
    """By case."""

    @cached_property
    def nameplates(self) -> Nameplates:
        """Nameplates in the order of the histories' columns."""
        return nameplates_of(self.scenario, self.feeder)

    def _nameplates_in(self, case: str) -> Nameplates:
        """Return the same without those that have no agent in a case, where sharing is meant."""
        return nameplates_of(self.scenario, self.feeder, case)

    def f(self, case: str) -> Floats:
        """Return the frequency (Hz), mean of the GFM."""
        return mean_frequency(self.histories[case], self.nameplates)

    def MPSI(self, case: str) -> Floats:
        """Return the mean power sharing index, (16)."""
        return MPSI(self.histories[case], self._nameplates_in(case))

    def MQSI(self, case: str) -> Floats:
        """Return the mean var sharing index, (17)."""
        return MQSI(self.histories[case], self._nameplates_in(case))

    def t(self, case: str) -> Floats:
        """Return the time of the rows (s)."""
        return self.histories[case].t

    def settling(self, case: str, start: float, end: float) -> Settling:
        """Return how a case settled from a time to another (s)."""
        return settling(
            self.histories[case], self._nameplates_in(case), Window(label="", start=start, end=end), self.feeder.f_nom
        )

    def mean(self, x: Floats, case: str, end: float) -> float:
        """Return the mean (of what x is) over the 0.2 s before a time (s), as steady values are measured."""
        t = self.t(case)
        return float(x[(t >= end - STEADY - 1e-9) & (t < end - 1e-9)].mean())

    def fleet(self, case: str) -> InverterGroup:
        """Return the inverters under the rule of a case."""
        return inverter_group_of(self.scenario, self.feeder, case)

    @cached_property
    def loads(self) -> dict[str, LoadStep]:
        """The step of load of each event, from the plant on droop alone."""
        steps = load_steps(without_faults(self.scenario), self.feeder)
        return {step.label: step.load for step in steps if step.load is not None}


def cut_between(fleet: InverterGroup, groups: Mapping[str, str]) -> set[tuple[str, str]]:
    """Return the links (src, dst) between members of different groups."""
    names = [name for name in fleet.names if name in groups]
    return {(a, b) for a in names for b in names if groups[a] != groups[b]}


def without(fleet: InverterGroup, links: set[tuple[str, str]]) -> InverterGroup:
    """Return the fleet as if these links (src, dst) were not there."""
    A = np.array(fleet.A)
    for src, dst in links:
        A[fleet.names.index(dst), fleet.names.index(src)] = 0.0
    return replace(fleet, A=A)


RunColumns = Mapping[str, Any]
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

    rows: Sequence[RunColumns]
    """All runs, in the order of the sweep."""
    base: ScenarioModel
    """The scenario that was varied."""
    window: str
    """Label of the event that is measured."""
    _fleets: dict[str, InverterGroup] = field(default_factory=dict)

    def where(self, equal: Mapping[str, Any] = _ALL) -> Iterator[RunColumns]:
        """Return the rows whose columns have these values."""
        return (row for row in self.rows if all(row[name] == value for name, value in equal.items()))

    def values(self, column: str, equal: Mapping[str, Any] = _ALL) -> list[Any]:
        """Return the different values of a column, sorted."""
        return sorted({row[column] for row in self.where(equal)})

    def measure(self, row: RunColumns, index: str) -> float:
        """Return an index of a row: infinite for a time that never came, not a number where a run broke."""
        value = row[f"{self.window}.{index}"]
        if value is not None:
            return float(value)
        return np.inf if index.startswith("t_") and row.get("status") != "broke" else np.nan

    def median(self, index: str, equal: Mapping[str, Any]) -> float:
        """Return the median of an index over the rows whose columns have these values."""
        return float(np.median([self.measure(row, index) for row in self.where(equal)]))

    def curve(
        self, x: str, index: str, equal: Mapping[str, Any], over: Callable[[Floats], Any] = np.median
    ) -> tuple[Floats, Floats]:
        """Return an index against a column, by default the median over all other columns."""
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
    def calm(self) -> ScenarioModel:
        """The scenario with links that do nothing, its first event alone, and an end before long."""
        return first_window(self.base, 3.0)

    @cached_property
    def load(self) -> LoadStep:
        """The step of load of the event, from the plant on droop alone."""
        (step,) = (step for step in load_steps(self.calm, self.feeder) if step.label == self.window)
        assert step.load is not None
        return step.load

    @cached_property
    def response(self) -> VarResponse:
        """How voltages and vars respond to V_set."""
        return var_response(self.calm, self.feeder)

    def fleet(self, case: str) -> InverterGroup:
        """Return the inverters under the rule of a case."""
        if case not in self._fleets:
            self._fleets[case] = inverter_group_of(self.base, self.feeder, case)
        return self._fleets[case]
