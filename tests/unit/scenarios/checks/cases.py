"""Sound cases for the tests of checks, and copies with a planted fault."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

import gridpeers as gp
from scenarios.checks.check_registry import chosen_checks
from scenarios.checks.check_verdict import CheckVerdict
from scenarios.checks.checked_case import CheckedCase
from scenarios.checks.communication.record_content import RecordContent
from scenarios.checks.judging import judge_case
from scenarios.results.history import History


@cache
def ran(name: str = "islanding", case: str = "IV") -> gp.Result:
    """A case of the catalogue, run once in this process."""
    return gp.load(name).run(case)


@cache
def ran_with(changes: tuple[tuple[str, Any], ...], case: str = "IV") -> gp.Result:
    """Islanding with other keys, run once; each change is a path and the `repr` of its value."""
    return gp.load("islanding").replace({path: eval(value) for path, value in changes}).run(case)


def changed(case: CheckedCase, edit: Callable[[dict[str, np.ndarray[Any, Any]]], None]) -> CheckedCase:
    """A case whose rows `edit` has changed: it gets copies of the arrays t, f, P, Q, V by name."""
    arrays = {name: getattr(case.history, name).copy() for name in ("t", "f", "P", "Q", "V", "P_set", "V_set")}
    edit(arrays)
    return replace(case, history=History(inverters=case.history.inverters, **arrays))


def with_content(case: CheckedCase, content: RecordContent) -> CheckedCase:
    """A case whose record has something else in it."""
    other = replace(case)
    other.__dict__["content"] = content
    return other


def verdict(case: CheckedCase, check: str, **limits: Any) -> CheckVerdict:
    """The verdict of one check on a case."""
    entries: Sequence[dict[str, Any]] = [{"use": check, **limits}]
    (found,) = judge_case(case, {check: chosen_checks(entries)[check]})
    return found
