"""Check of laws: none fails."""

from __future__ import annotations

from collections.abc import Iterator

from gridpeers.scenarios.checks.check_verdict import Check, NotJudgedError, Violation
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.results.law_failures import law_failures


class LawFailed(Check):
    """No agent's law, and no graph of a user, fails: its inverter would go on on primary droop."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        """Yield each failure."""
        failures = law_failures(case.events)
        if not failures and case.scenario.cases[case.case].secondary == "none":
            raise NotJudgedError("no inverter runs a law")
        for failure in failures:
            yield Violation(text=failure.why, t=failure.t, agent=failure.agent)
