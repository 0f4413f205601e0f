"""Checks of events: no law fails, and inverters that have tripped are in service again at the end."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from gridpeers.scenarios.checks.check_verdict import Check, NotJudgedError, Violation
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.results.recorded_events import law_failures, tripped_by, tripped_inverters


class LawFailed(Check):
    """No agent's law, and no graph of a user, fails: its inverter would go on on primary droop."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        failures = law_failures(case.events)
        if not failures and case.scenario.cases[case.case].secondary == "none":
            raise NotJudgedError("no inverter runs a law")
        for failure in failures:
            yield Violation(text=failure.why, t=failure.t, agent=failure.agent)


class Returned(Check):
    """At the end of the run, every inverter that has tripped is in service again, unless its agent had it leave.

    A run must be long enough for that: an inverter returns `protection.enter_service_s` after voltage and frequency at
    its terminals have become normal. After three trips without a minute in service between
    it stays off.
    """

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        trips = Counter(name for event in case.events for name in tripped_by(event))
        if not trips:
            raise NotJudgedError("no inverter tripped")
        off = tripped_inverters(case.events)
        for name in sorted(off.keys() & set(case.history.inverters), key=lambda name: (off[name].t, name)):
            yield Violation(
                text=f"not back in service, {off[name].text}",
                t=off[name].t,
                agent=name,
                value=trips[name],
                unit="trips",
            )
