"""Judge a recorded case by checks: each may fail without harm to the others."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from itertools import islice
from typing import Any

import numpy as np

from scenarios.checks.check_registry import CHECKS
from scenarios.checks.check_verdict import MOST_VIOLATIONS, SHOWN_VIOLATIONS, CheckVerdict, NotJudgedError, Violation
from scenarios.checks.checked_case import CheckedCase
from wire.plugins.anybody import ANYTHING, named
from wire.plugins.plugin import Plugin, made
from wire.plugins.registry import PluginError
from wire.printable import printable


def judge_case(case: CheckedCase, checks: Mapping[str, Plugin]) -> tuple[CheckVerdict, ...]:
    """Return the verdict of each check on a case.

    A check that raises an error has failed, with the error as its reason: nothing is taken for right unjudged.

    Parameters
    ----------
    case : CheckedCase
        The case.
    checks : Mapping[str, Plugin]
        The checks by their names in the verdict (`check_registry.chosen_checks`).
    """
    with np.errstate(all="ignore"):  # a value that is no number is within no limit, or has its own reason
        return tuple(_verdict(name, plugin, case) for name, plugin in checks.items())


def _verdict(name: str, plugin: Plugin, case: CheckedCase) -> CheckVerdict:
    try:
        found = made(CHECKS, plugin)(case)
        if not isinstance(found, Iterable) or isinstance(found, str | Mapping):
            raise TypeError(f"returned {printable(repr(found), 60)}; return violations, none for a run that passes")
        violations: list[Violation] = []
        count = 0
        for count, violation in enumerate(islice(found, MOST_VIOLATIONS), 1):
            checked = _checked(violation)
            if count <= SHOWN_VIOLATIONS:
                violations.append(checked)
    except NotJudgedError as error:
        return CheckVerdict(check=name, status="not judged", reason=printable(str(error), 300) or "no reason given")
    except PluginError as error:
        return CheckVerdict(check=name, status="failed", reason=printable(str(error), 300))
    except ANYTHING as error:  # a check is a user's code
        return CheckVerdict(check=name, status="failed", reason=f"cannot judge: {named(error)}")
    return CheckVerdict(
        check=name,
        status="failed" if violations else "passed",
        violations=tuple(violations),
        count=count,
    )


def _checked(violation: Any) -> Violation:
    """Return a violation whose fields are what they are said to be: it is a user's."""
    if not isinstance(violation, Violation):
        raise TypeError(f"yielded {printable(repr(violation), 60)}; yield a gridpeers.Violation")
    return Violation(
        text=printable(str(violation.text), 200),
        t=_number(violation.t),
        agent=printable(str(violation.agent), 60),
        value=_number(violation.value),
        unit=printable(str(violation.unit), 20),
        limit=_number(violation.limit),
    )


def _number(value: Any) -> float | None:
    """Return a value as a finite number; None where there is none."""
    if value is None:
        return None
    number = float(value)
    return number if math.isfinite(number) else None
