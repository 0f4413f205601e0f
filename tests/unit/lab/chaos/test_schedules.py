"""Schedules: each is a valid scenario that inverters can feed; a seed draws the same ones; hypothesis shrinks them."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest
from hypothesis import given, settings
from msgspec import json

from gridpeers.lab.chaos import schedules as schedules_of_chaos
from gridpeers.lab.chaos.disturbed_scenario import (
    JUDGED_S,
    KINDS,
    WITHIN_S,
    Disturbance,
    Schedule,
    base_of,
    chaos_checks,
)
from gridpeers.lab.chaos.schedules import BATCH, MOST_DISTURBANCES, drawn, schedules, shrunk
from gridpeers.scenarios.checks.check_registry import ALWAYS, CHECKS, check_name
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.scenario_writing import to_toml
from gridpeers.wire.plugins.plugin import table_of
from gridpeers.wire.schema.table_schema import fields_of
from tests.scenario_files import written
from tests.unit.lab.chaos.bases import NAMES, base_named

CUT = Disturbance(table="link", entry={"on": "* <-> *", "from_s": 2.0, "to_s": 3.0, "cut": True})
LEAVE = Disturbance(table="event", entry={"t_s": 2.0, "leave": ["inv2"]}, back={"t_s": 3.0, "join": ["inv2"]})


@cache
def _batch(number: int) -> list[Schedule]:
    return drawn(base_named("islanding"), 1, number)


@pytest.mark.parametrize("name", NAMES[1:])
def test_every_schedule_is_a_scenario_file_that_loads_and_can_be_fed(name: str, tmp_path: Path) -> None:
    """The file of each schedule that is drawn has no problem, gives the same scenario, and has time to recover."""
    base = base_named(name)

    @settings(max_examples=5, database=None)
    @given(schedules(base))
    def holds(schedule: Schedule) -> None:
        scenario = base.disturbed(schedule, 7)
        file = written(tmp_path, to_toml(scenario, {}, terse=True))
        last = max([base.settled_s, *(it.settled_s for it in schedule)])

        assert load_scenario(file)[0] == scenario
        assert base.supply.objection(scenario, base.case) == ""
        assert scenario.time.end_s >= last + WITHIN_S + JUDGED_S - 1e-9

    holds()


def test_batches_have_schedules_of_their_own_and_every_kind_of_disturbance() -> None:
    """Each has its number of schedules, of up to the most disturbances; together they have each kind of the report."""
    base = base_named("islanding")
    both = [it for schedule in (*_batch(0), *_batch(1)) for it in schedule]

    assert base_of(base.text).scenario == base.scenario, "workers draw from its text"
    assert len(_batch(0)) == len(_batch(1)) == BATCH
    assert _batch(0)[1:] != _batch(1)[1:]
    assert 3 < max(map(len, _batch(0))) <= MOST_DISTURBANCES
    assert {it.kind for it in both} == set(KINDS)


@pytest.mark.parametrize(
    ("names", "fits"),
    [(("inv2",), True), (("inv1", "inv4", "inv7"), False), (("inv1", "inv2", "inv3", "inv4", "inv5", "inv6"), False)],
)
def test_what_no_control_can_feed_is_left_out(names: tuple[str, ...], fits: bool) -> None:
    """Without a grid-forming inverter, or with too few inverters for the load, there is nothing to judge."""
    leave = Disturbance(table="event", entry={"t_s": 2.0, "leave": list(names)})

    assert base_named("islanding").is_possible((leave,)) == fits


def test_a_switch_that_waits_for_synchronism_may_never_close() -> None:
    """A leader beyond a switch that is still to close does not count as one: the island may go on without."""
    close = Disturbance(table="event", entry={"t_s": 3.0, "close": ["18-135"], "synchronised": True})
    kill = Disturbance(table="node", entry={"name": "inv7", "from_s": 0.4, "kill": True})

    assert base_named("microgrid-switching").is_possible((close,))
    assert not base_named("microgrid-switching").is_possible((close, kill))


def test_shrinking_runs_each_schedule_once_and_no_more_than_it_may(monkeypatch: pytest.MonkeyPatch) -> None:
    """The disturbances that are left out one by one at the end count, too, and have a part of the runs for them."""
    base, tries = base_named("islanding"), 20
    monkeypatch.setattr(schedules_of_chaos, "TRIES", tries)
    asked: list[Schedule] = []

    def fails(schedule: Schedule) -> bool:
        asked.append(schedule)
        return len(schedule) > 1

    number = next(i for i, schedule in enumerate(_batch(1)) if len(schedule) > 3)
    simplest = shrunk(base, 1, BATCH + number, fails)

    assert 1 < len(simplest) < len(_batch(1)[number])
    assert 0 < len(asked) <= tries
    assert len({json.encode(schedule) for schedule in asked}) == len(asked)


def test_every_check_with_a_first_time_gets_one_of_the_schedule() -> None:
    """A check with the limit `since_s` judges nothing before the last disturbance has ended."""
    entries = {check_name(entry): table_of(entry) for entry in chaos_checks((), 4.0, 9.0)}
    with_first_time = {name for name in ALWAYS if "since_s" in {it.key for it in fields_of(CHECKS.resolve(name))}}

    assert {name for name, limits in entries.items() if limits.get("since_s", 0.0) >= 4.0} == with_first_time
