"""A part of the cross-validation: cases, each a row of its table."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib.metadata import PackageNotFoundError, version
from math import floor, log10
from typing import Any, Literal, NamedTuple

from gridpeers.plant.equipment import InverterRow

Kind = Literal["GFM", "GFL"]


class ToleranceCheck(NamedTuple):
    """A number of a case and the limit that it must keep."""

    quantity: str
    """Head of its column, with the unit: "V, pu"."""
    value: float
    """Mostly the largest difference between our plant and the reference; nan if there is none, which fails."""
    limit: float
    """The largest value that passes."""
    at_least: bool = False
    """Whether the limit is the smallest value that passes instead."""

    @property
    def passed(self) -> bool:
        """Whether the limit is kept."""
        return self.value >= self.limit if self.at_least else self.value <= self.limit

    def text(self) -> str:
        """Write the value; a difference is rounded up to 1, 2 or 5 times a power of ten, which hides noise."""
        if self.at_least:
            return f"{self.value:.3g}"
        return rounded_up(self.value)


class CaseResult(NamedTuple):
    """A case that was run: a row of its part's table."""

    case: str
    checks: tuple[ToleranceCheck, ...]
    facts: Mapping[str, str] = {}
    """Further columns: how many states, where the largest difference is. Nothing that changes from run to run."""

    def broken(self) -> list[str]:
        """Return a sentence for each limit that is not kept."""
        return [
            f"{self.case}: {each.quantity}: {each.value:.3g} is {'below' if each.at_least else 'beyond'} {each.limit:g}"
            for each in self.checks
            if not each.passed
        ]


class ValidationPart(NamedTuple):
    """A part of the cross-validation: its cases, and how one is run."""

    name: str
    """On the command line."""
    needs: tuple[str, ...]
    """Distributions of the reference programs: "gridlabd"."""
    cases: Mapping[str, str]
    """Each case's name, and what it is in a few words."""
    run: Callable[[str], CaseResult]
    """Run a case, by its name."""
    run_short: Callable[[str], CaseResult] | None = None
    """The same case in less time, with the same limits, for the tests; `run` if left out."""

    def missing(self) -> str:
        """Return which distributions are missing and how to install them; empty if none is."""
        absent = [name for name in self.needs if not _version(name)]
        if not absent:
            return ""
        return f"{self.name} needs {', '.join(absent)}: pip install 'gridpeers[validation]'"

    def references(self) -> str:
        """Return the reference programs with their versions: "gridlabd 6.0.0"."""
        return ", ".join(f"{name} {_version(name)}" for name in self.needs)


def inverter_row(name: str, kind: Kind, bus: str, P_rated: float, V_nom: float, **own: Any) -> InverterRow:
    """Return an inverter of a feeder, with droops of 1 and 5 % and no microgrid unless its own keys say otherwise."""
    usual: dict[str, Any] = {"microgrid": "", "m_p": 0.01, "m_q": 0.05}
    return InverterRow(name=name, kind=kind, bus=bus, P_rated=P_rated, V_nom=V_nom, **(usual | own))


def rounded_up(value: float) -> str:
    """Write a difference as the next of 1, 2 and 5 times a power of ten: "2e-11"."""
    if value == 0.0:
        return "0"
    if not 0.0 < value < float("inf"):
        return str(value)
    exponent = floor(log10(value))
    digit = next(digit for digit in (1, 2, 5, 10) if value <= digit * 10.0**exponent * (1 + 1e-12))
    return f"{float(f'{digit}e{exponent}'):g}"


def _version(distribution: str) -> str:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return ""
