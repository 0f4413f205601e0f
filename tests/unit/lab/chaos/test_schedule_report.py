"""The report of a schedule: a disturbance of an agent that is away does not happen, and its line says so."""

from __future__ import annotations

from pathlib import Path

from gridpeers.lab.chaos.campaign import Campaign, Summary
from gridpeers.lab.chaos.chaos_folder import ChaosFolder
from gridpeers.lab.chaos.chaos_run import ChaosRow, run_schedule
from gridpeers.lab.chaos.disturbance import Disturbance, Schedule
from tests.unit.lab.chaos.bases import base_in
from tests.unit.lab.chaos.small_campaign import SMALL

AWAY = Disturbance(table="event", entry={"t_s": 0.3, "leave": ["inv4"]}, back={"t_s": 0.6, "join": ["inv4"]})


def _lie(name: str, begin: float, end: float) -> Disturbance:
    lie = {"model": "offset", "P_set_W": 300e3, "Q_var": 300e3}
    return Disturbance(table="node", entry={"name": name, "from_s": begin, "to_s": end, "lies": lie})


def test_a_lie_of_an_agent_that_has_left_changes_nothing_and_the_report_says_so(tmp_path: Path) -> None:
    """The run has the same bytes without it; report and scenario say why, and it is no lie of the count."""
    (file := tmp_path / "small.toml").write_text(SMALL.format(extra=""), encoding="utf-8")
    base = base_in(file)
    schedule = (_lie("inv4", 0.3, 0.6), AWAY)
    row, without = (run_schedule(base, which, 1) for which in (schedule, (AWAY,)))
    found = ChaosRow(number=0, schedule=schedule, violated={"ends": "no"})
    failed = ChaosFolder(tmp_path, base, 1, "").write_failure("ends", found, row)
    summary = Summary(campaign=Campaign(base=base, seed=1, runs=1), rows={0: row}, failures=())

    assert base.is_possible(schedule)
    assert (row.history_sha256, row.passed) == (without.history_sha256, without.passed)
    assert "(nothing happens: inv4 has left at 0.3 s)" in failed.read_text(encoding="utf-8")
    assert next(summary.lines()).endswith("; disturbances: 1 leave")


def test_only_who_is_away_all_the_time_does_nothing(tmp_path: Path) -> None:
    """A lie that begins before the leave, or ends after the return, or is another agent's, happens."""
    (file := tmp_path / "small.toml").write_text(SMALL.format(extra=""), encoding="utf-8")
    base = base_in(file)
    early, late, idle = _lie("inv4", 0.2, 0.4), _lie("inv4", 0.5, 0.7), _lie("inv4", 0.4, 0.5)
    schedule: Schedule = (late, idle, AWAY, early, _lie("inv1", 0.3, 0.5))

    assert base.is_possible(schedule)
    assert base.effective(schedule) == tuple(it for it in schedule if it is not idle)
    assert ["nothing happens" in line for line in base.lines(schedule)] == [False, False, False, True, False]
