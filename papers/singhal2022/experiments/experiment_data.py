"""The data of an experiment: histories of cases or rows of a sweep, and the predictions of theory."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from gridpeers import measures, theory
from gridpeers.measures import STEADY, Floats, History, Settling, Window, nameplates_of


@dataclass(frozen=True, kw_only=True)
class CaseData:
    """A scenario that was run, with the history of each case."""

    scenario: theory.ScenarioModel
    feeder: theory.Tables
    histories: Mapping[str, History]

    def t(self, case: str) -> Floats:
        return self.histories[case].t

    def f(self, case: str) -> Floats:
        """Return the frequency (Hz), mean of the GFM."""
        return measures.mean_frequency(self.histories[case], nameplates_of(self.scenario, self.feeder))

    def MPSI(self, case: str) -> Floats:
        """Return the mean power sharing index of the inverters with an agent, (16)."""
        return measures.MPSI(self.histories[case], nameplates_of(self.scenario, self.feeder, case))

    def settling(self, case: str, start: float, end: float) -> Settling:
        """Return the settling of a case between two times (s)."""
        nameplates = nameplates_of(self.scenario, self.feeder, case)
        window = Window(label="", start=start, end=end)
        return measures.settling(self.histories[case], nameplates, window, self.feeder.f_nom)

    def mean(self, x: Floats, case: str, end: float) -> float:
        """Return the mean over the 0.2 s before a time (s), as steady values are measured."""
        t = self.t(case)
        return float(x[(t >= end - STEADY - 1e-9) & (t < end - 1e-9)].mean())

    def inverters(self, case: str) -> theory.InverterGroup:
        """Return the inverters under the rule of a case."""
        return theory.inverter_group_of(self.scenario, self.feeder, case)

    @cached_property
    def loads(self) -> dict[str, theory.LoadStep]:
        """The step of load of each event, from the plant on droop alone."""
        steps = theory.load_steps(theory.without_faults(self.scenario), self.feeder)
        return {step.label: step.load for step in steps if step.load is not None}


def without(inverters: theory.InverterGroup, links: Iterable[tuple[str, str]]) -> theory.InverterGroup:
    """Return the inverters without these links (src, dst)."""
    A = np.array(inverters.A)
    for src, dst in links:
        A[inverters.names.index(dst), inverters.names.index(src)] = 0.0
    return replace(inverters, A=A)


INDEXES = {"t_f_s": ("f", "Frequency within 0.01 Hz"), "t_share_s": ("sharing", "Power shared, MPSI < 0.01")}
"""The two times of an event in most experiments: index, word in a table, title of a panel."""


def times_of(predicted: theory.Times) -> dict[str, float]:
    """Return the times to restore and to share (s) by their index; infinite for never."""
    times = zip(INDEXES, (predicted.restore_s, predicted.share_s), strict=True)
    return {index: np.inf if t is None else t for index, t in times}


@dataclass(frozen=True, kw_only=True)
class SweepData:
    """A sweep that is done.

    >>> table = pd.DataFrame({"case": "a", "link[0].delay": [0.1, 0.0, 0.2], "e.t_f_s": [2.0, 1.0, None]})
    >>> sweep = SweepData(rows=table, base=None, window="e")
    >>> sweep.curve("link[0].delay", "t_f_s", {"case": "a"})
    (array([0. , 0.1, 0.2]), array([ 1.,  2., inf]))
    """

    rows: pd.DataFrame
    """All runs, in the order of the sweep."""
    base: theory.ScenarioModel
    """The scenario that was varied."""
    window: str
    """Label of the event that is measured."""

    def where(self, equal: Mapping[str, Any]) -> pd.DataFrame:
        """Return the rows whose columns have these values."""
        keep = np.ones(len(self.rows), bool)
        for name, value in equal.items():
            keep &= (self.rows[name] == value).to_numpy()
        return self.rows[keep]

    def values(self, column: str, equal: Mapping[str, Any] | None = None) -> list[Any]:
        """Return the different values of a column, sorted."""
        return sorted(self.where(equal or {})[column].unique().tolist())

    def measured(self, index: str, rows: pd.DataFrame) -> Floats:
        """Return an index of some rows: infinite for never, nan for a run that broke."""
        values = rows[f"{self.window}.{index}"].to_numpy(float)
        ran = rows["status"].to_numpy() == "ran" if "status" in rows else True
        return np.where(np.isnan(values) & ran & index.startswith("t_"), np.inf, values)

    def median(self, index: str, equal: Mapping[str, Any]) -> float:
        """Return the median of an index over the rows whose columns have these values."""
        return float(np.median(self.measured(index, self.where(equal))))

    def curve(
        self, x: str, index: str, equal: Mapping[str, Any], over: Callable[[Floats], Any] = np.median
    ) -> tuple[Floats, Floats]:
        """Return an index against a column, by default the median over all other columns."""
        at = self.values(x, equal)
        found = [float(over(self.measured(index, self.where({**equal, x: value})))) for value in at]
        return np.array(at, float), np.array(found)

    def range(self, x: str, index: str, equal: Mapping[str, Any]) -> tuple[Floats, Floats]:
        """Return the least and the greatest of an index against a column."""
        return self.curve(x, index, equal, np.min)[1], self.curve(x, index, equal, np.max)[1]

    def names(self, cases: Iterable[str]) -> dict[int, str]:
        """Return the titles of cases by their place, for a legend."""
        return {style: self.base.cases[case].title for style, case in enumerate(cases)}

    @cached_property
    def feeder(self) -> theory.Tables:
        return theory.feeder_of(self.base)

    @cached_property
    def calm(self) -> theory.ScenarioModel:
        """The scenario with good links, only its first event, and an early end."""
        return theory.first_window(self.base, 3.0)

    @cached_property
    def load(self) -> theory.LoadStep:
        """The step of load of the event, from the plant on droop alone."""
        (step,) = (step for step in theory.load_steps(self.calm, self.feeder) if step.label == self.window)
        assert step.load is not None
        return step.load

    @cached_property
    def response(self) -> theory.VarResponse:
        """How voltages and vars respond to V_set."""
        return theory.var_response(self.calm, self.feeder)

    @cached_property
    def inverters(self) -> Mapping[str, theory.InverterGroup]:
        """The inverters under the rule of each case."""
        return {case: theory.inverter_group_of(self.base, self.feeder, case) for case in self.base.cases}

    @cached_property
    def _predicted(self) -> dict[tuple[str, float, float], dict[str, float]]:
        return {}

    def predicted(self, case: str, *, link_delay_s: float = 0.0, loss: float = 0.0) -> dict[str, float]:
        """Return the times of a case over late or lossy links, by theory, as `times_of`."""
        key = case, link_delay_s, loss
        if key not in self._predicted:
            times = theory.predicted_times(self.inverters[case], link_delay_s=link_delay_s, loss=loss, load=self.load)
            self._predicted[key] = times_of(times)
        return self._predicted[key]

    def theory(self, index: str, case: str, **over: Iterable[float]) -> tuple[Floats, Floats]:
        """Return a predicted time over delays or losses, `link_delay_s=[...]` or `loss=[...]`, and these."""
        ((what, values),) = over.items()
        found = [(x, self.predicted(case, **{what: x})[index]) for x in values]
        return np.array(found).T[0], np.array(found).T[1]
