"""Runs a case of the cross-validation, and asserts what the page would say."""

from __future__ import annotations

import pytest

from bench.validation.validation_part import CaseResult, ValidationPart


def assert_limits_kept(part: ValidationPart, case: str) -> CaseResult:
    """Run a case and fail with every limit that it breaks; skip where a reference is not installed."""
    if missing := part.missing():
        pytest.skip(missing)
    result = (part.run_short or part.run)(case)
    if broken := result.broken():  # an assert in a module that is no test would not show them
        pytest.fail("\n".join(broken))
    if not result.checks:
        pytest.fail(f"{part.name}: {case} checks nothing")
    return result
