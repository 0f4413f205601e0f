"""The cases of a scenario with their histories, for experiments that are seen over time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gridpeers.measures import (
    MPSI,
    MQSI,
    STEADY,
    Floats,
    History,
    Plates,
    Settling,
    Window,
    mean_frequency,
    plates_of,
    settling,
)
from gridpeers.theory import Feeder, Fleet, LoadStep, Spec, fleet_of, load_steps, without_faults


@dataclass(frozen=True, kw_only=True)
class CaseData:
    """A scenario that was run."""

    scenario: Spec
    feeder: Feeder
    histories: Mapping[str, History]
    """By case."""

    @cached_property
    def plates(self) -> Plates:
        """Nameplates in the order of the histories' columns."""
        return plates_of(self.scenario, self.feeder)

    def _plates_in(self, case: str) -> Plates:
        """The same without those that have no agent in a case, where sharing is meant."""
        return plates_of(self.scenario, self.feeder, case)

    def f(self, case: str) -> Floats:
        """Frequency (Hz), mean of the GFM."""
        return mean_frequency(self.histories[case], self.plates)

    def MPSI(self, case: str) -> Floats:
        """Mean power sharing index, (16)."""
        return MPSI(self.histories[case], self._plates_in(case))

    def MQSI(self, case: str) -> Floats:
        """Mean var sharing index, (17)."""
        return MQSI(self.histories[case], self._plates_in(case))

    def t(self, case: str) -> Floats:
        """Time of the rows (s)."""
        return self.histories[case].t

    def settling(self, case: str, start: float, end: float) -> Settling:
        """How a case settled from a time to another (s)."""
        return settling(
            self.histories[case], self._plates_in(case), Window(label="", start=start, end=end), self.feeder.f_nom
        )

    def mean(self, x: Floats, case: str, end: float) -> float:
        """Mean (of what x is) over the 0.2 s before a time (s), as steady values are measured."""
        t = self.t(case)
        return float(x[(t >= end - STEADY - 1e-9) & (t < end - 1e-9)].mean())

    def fleet(self, case: str) -> Fleet:
        """The inverters under the rule of a case."""
        return fleet_of(self.scenario, self.feeder, case)

    @cached_property
    def loads(self) -> dict[str, LoadStep]:
        """The step of load of each event, from the plant on droop alone."""
        steps = load_steps(without_faults(self.scenario), self.feeder)
        return {step.label: step.load for step in steps if step.load is not None}


def cut_between(fleet: Fleet, groups: Mapping[str, str]) -> set[tuple[str, str]]:
    """Links (src, dst) between members of different groups."""
    names = [name for name in fleet.names if name in groups]
    return {(a, b) for a in names for b in names if groups[a] != groups[b]}


def without(fleet: Fleet, links: set[tuple[str, str]]) -> Fleet:
    """The fleet as if these links (src, dst) were not there."""
    A = np.array(fleet.A)
    for src, dst in links:
        A[fleet.names.index(dst), fleet.names.index(src)] = 0.0
    return replace(fleet, A=A)
