"""Judge a recorded case by checks: each may fail without harm to the others."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from itertools import islice
from typing import Any

import numpy as np

from gridpeers.scenarios.checks.check_registry import CHECKS, chosen_checks, switched_off
from gridpeers.scenarios.checks.check_verdict import (
    MOST_VIOLATIONS,
    SHOWN_VIOLATIONS,
    CheckStatus,
    CheckVerdict,
    NotJudgedError,
    Violation,
)
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.wire.plugins.plugin import Plugin, made
from gridpeers.wire.plugins.registry import ANYTHING, PluginError, named
from gridpeers.wire.wording import printable


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
        for number, violation in enumerate(islice(found, MOST_VIOLATIONS), 1):
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
