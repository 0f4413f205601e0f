"""Checks of a run with disturbances: each that can begin late does."""

from __future__ import annotations

from gridpeers.lab.chaos.chaos_checks import chaos_checks
from gridpeers.scenarios.checks.check_registry import ALWAYS, CHECKS, check_name
from gridpeers.wire.plugins.plugin import table_of
from gridpeers.wire.schema.table_schema import fields_of


def test_every_check_with_a_first_time_gets_one_of_the_schedule() -> None:
    """A check with the limit `since_s` judges nothing before the last disturbance has ended."""
    entries = {check_name(entry): table_of(entry) for entry in chaos_checks((), 4.0, 9.0)}
    with_first_time = {name for name in ALWAYS if "since_s" in {it.key for it in fields_of(CHECKS.resolve(name))}}

    assert {name for name, limits in entries.items() if limits.get("since_s", 0.0) >= 4.0} == with_first_time
