"""Checks of a recorded case, and their verdicts: status, and violations with time, agent, value, unit and limit."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import msgspec
import numpy as np

from gridpeers.scenarios.checks.check_registry import CHECKS, chosen_checks, switched_off
from gridpeers.scenarios.results.history import History
from gridpeers.wire.plugins.plugin import Plugin, made
from gridpeers.wire.plugins.registry import ANYTHING, PluginError, named
from gridpeers.wire.schema.table_schema import Plausible, Unit
from gridpeers.wire.wording import printable

if TYPE_CHECKING:
    from gridpeers.scenarios.checks.checked_case import CheckedCase


CheckStatus = Literal["passed", "failed", "not judged", "off"]  # Off: the scenario takes it out of the verdict

SHOWN_VIOLATIONS = 20  # Most violations that a verdict keeps; it counts all


class NotJudgedError(Exception):
    """A check cannot judge this run; the text is the reason."""


class Check:
    """Base of all checks of your own: annotate the limits, and write `__call__` (docs/how-to/plug-ins.md).

    `__call__` gets a `CheckedCase` and yields its violations.
    """

    def __call__(self, case: CheckedCase) -> Iterable[Violation]:
        """Yield the violations of a recorded case; raise NotJudgedError if it cannot be judged."""
        raise NotImplementedError


class Violation(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One violation of a limit."""

    text: str
    t: float | None = None
    """Run time (s)."""
    agent: str = ""
    """Agent or inverter; the receiver of a link; empty for the whole network."""
    value: float | None = None
    unit: str = ""
    """Unit of value and limit; empty for a pure number."""
    limit: float | None = None
    """Limit that it violates."""

    @property
    def sentence(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        found = [self.agent] if self.agent else []
        found += [f"{self.value:.3g}{unit}"] if self.value is not None else []
        found += [f"at t = {self.t:.2f} s"] if self.t is not None else []
        found += [f"(limit {self.limit:g}{unit})"] if self.limit is not None else []
        return f"{self.text}: {' '.join(found)}" if found else self.text


class CheckVerdict(msgspec.Struct, frozen=True, kw_only=True):
    """The verdict of one check on one case."""

    check: str
    status: CheckStatus
    reason: str = ""
    """Reason for "not judged" or "off", or the exception of a failed check."""
    violations: tuple[Violation, ...] = ()
    """The first 20 violations."""
    count: int = 0
    """Number of violations."""

    @property
    def detail(self) -> str:
        """The first violation, how many more there are, and the reason; empty without any."""
        more = f", and {self.count - 1} more" if self.count > 1 else ""
        found = [self.violations[0].sentence + more] if self.violations else []
        return "; ".join([*found, *filter(None, [self.reason])])

    @property
    def sentence(self) -> str:
        return f"{self.check} {self.status}" + (f": {self.detail}" if self.detail else "")


def counts(verdicts: tuple[CheckVerdict, ...]) -> str:
    """Return how many checks a case passed, how many were not judged, and the names of those that are off."""
    passed = sum(verdict.status == "passed" for verdict in verdicts)
    failed = sum(verdict.status == "failed" for verdict in verdicts)
    off = [verdict.check for verdict in verdicts if verdict.status == "off"]
    idle = len(verdicts) - passed - failed - len(off)
    line = f"{passed} of {passed + failed} checks passed" + (f", {idle} not judged" if idle else "")
    return line + (f", {', '.join(off)} switched off" if off else "")


def summary(verdicts: tuple[CheckVerdict, ...]) -> str:
    """Return the verdict of a case on one line: its counts, and each check that failed."""
    return "; ".join([counts(verdicts), *(verdict.sentence for verdict in verdicts if verdict.status == "failed")])


FILE = "checks.json"  # Name of the file in the run folder


def verdicts_json(verdicts: Mapping[str, tuple[CheckVerdict, ...]]) -> str:
    return msgspec.json.format(msgspec.json.encode(verdicts), indent=1).decode() + "\n"


def read_verdicts(path: Path) -> dict[str, tuple[CheckVerdict, ...]]:
    """Read a checks.json. Raise ValueError if it is none."""
    return msgspec.json.decode(path.read_bytes(), type=dict[str, tuple[CheckVerdict, ...]])


def judge_case(case: CheckedCase) -> tuple[CheckVerdict, ...]:
    """Return the verdict of each check of the scenario on a case; those that it switches off come last."""
    entries, why = case.scenario.checks, "switched off by the scenario"
    off = (CheckVerdict(check=name, status="off", reason=why) for name in switched_off(entries))
    return *judge_by(chosen_checks(entries), case), *off


def judge_by(checks: Mapping[str, Plugin], case: CheckedCase) -> tuple[CheckVerdict, ...]:
    """Return the verdict of each of some checks on a case.

    A check that raises an error has failed, with the error as its reason: nothing is taken for right unjudged. What it
    has yielded before counts, whatever it raises then, also `NotJudgedError`.
    """
    with np.errstate(all="ignore"):  # a value that is no number is within no limit
        return tuple(_verdict(name, plugin, case) for name, plugin in checks.items())


def _verdict(name: str, plugin: Plugin, case: CheckedCase) -> CheckVerdict:
    violations: list[Violation] = []
    count, raised = 0, ""
    try:
        found = made(CHECKS, plugin)(case)
        if not isinstance(found, Iterable) or isinstance(found, str | Mapping):
            raise TypeError(f"returned {printable(repr(found), 60)}; return violations, none for a run that passes")
        for number, violation in enumerate(found, 1):
            checked, count = _checked(violation), number
            if count <= SHOWN_VIOLATIONS:
                violations.append(checked)
    except NotJudgedError as error:
        raised = printable(str(error), 300) or "no reason given"
        if not violations:
            return CheckVerdict(check=name, status="not judged", reason=raised)
        raised = f"not judged further: {raised}"
    except PluginError as error:
        raised = printable(str(error), 300)
    except ANYTHING as error:  # a check is a user's code
        raised = f"cannot judge{' further' if violations else ''}: {named(error)}"
    status: CheckStatus = "failed" if violations or raised else "passed"
    return CheckVerdict(check=name, status=status, reason=raised, violations=tuple(violations), count=count)


def _checked(violation: Any) -> Violation:
    if not isinstance(violation, Violation):
        raise TypeError(f"yielded {printable(repr(violation), 60)}; yield a gridpeers.Violation")
    return Violation(
        text=printable(str(violation.text), 400),
        t=_number(violation.t),
        agent=printable(str(violation.agent), 60),
        value=_number(violation.value),
        unit=printable(str(violation.unit), 20),
        limit=_number(violation.limit),
    )


def _number(value: Any) -> float | None:
    return None if value is None or not math.isfinite(number := float(value)) else number


Since = Annotated[
    float,
    Unit("s"),
    Plausible("a time of the run", 0.0, 86_400.0),
    "Run time (s) from which the check judges, for example the end of the last fault.",
]
"""Key of a check that does not judge the start of a run: only events open windows, the end of a fault opens none."""

WithKilled = Annotated[
    bool, "Whether inverters of agents that the scenario kills count; they stay at their last set-points."
]


def require_time(history: History, since_s: float) -> None:
    """Raise NotJudgedError if a run ends before a check begins to judge: it would pass unjudged."""
    end = float(history.t[-1])
    if since_s > end:
        raise NotJudgedError(f"the run ends at {end:g} s, before since_s = {since_s:g} s")


def require_longer(judged_s: float, limit: str, limit_s: float) -> None:
    """Raise NotJudgedError if nothing in a run is long enough to break a limit of time: it would pass unjudged."""
    if judged_s <= limit_s + 1e-9:
        raise NotJudgedError(
            f"the run is shorter than needed: it has {judged_s:g} s to judge, and {limit} = {limit_s:g} s"
        )
