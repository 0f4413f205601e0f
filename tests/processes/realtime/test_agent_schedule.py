"""Agents that leave and return as the scenario says, with real processes: the old one ends, a new one is started."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from gridpeers.scenarios.drivers.children import Child
from gridpeers.scenarios.run_request import Outcome
from tests.toy.toy_configs import Schedule, toy_configs
from tests.toy.toy_runs import ProcessRun, exists

AWAY: Schedule = ((0.2, "inv2", "leave"), (0.3, "inv2", "join"))


def run_of(folder: Path, schedule: Schedule, clock: str) -> tuple[ProcessRun, Outcome]:
    """A short run of the toy in simulated or wall-clock time."""
    plant, agents = toy_configs(3, end=0.4 if clock == "simulated" else 3.0, schedule=schedule)
    run = ProcessRun(
        replace(plant, clock=clock),  # type: ignore[arg-type]
        [replace(agent, clock=clock) for agent in agents],  # type: ignore[arg-type]
        folder,
    )
    return run, run()


def lives(run: ProcessRun, name: str) -> tuple[Child, ...]:
    """All processes that ran under a name."""
    assert run.children is not None
    return run.children.lives(name)


@pytest.mark.parametrize(
    ("clock", "schedule"),
    [("simulated", AWAY), ("wall", ((0.4, "inv2", "leave"), (0.8, "inv2", "join")))],
)
def test_the_process_ends_and_a_new_one_is_started(tmp_path: Path, clock: str, schedule: Schedule) -> None:
    """The leaver's process ends well before the new one starts, both end with status 0, and each has its own log."""
    run, outcome = run_of(tmp_path, schedule, clock)
    first, second = lives(run, "inv2")
    moved = [event.text.split()[1].rstrip(",") for event in outcome.events if event.kind == "inverter"]

    assert outcome.broke == ""
    assert outcome.reproducible == (clock == "simulated")
    assert (first.status, second.status) == (0, 0)
    assert first.pid != second.pid
    assert not exists(second.pid)
    assert moved == ["disconnected", "connected"]
    assert "leaves at t = " in first.log.read_text()
    assert second.log.name == "inv2-2.log"
    assert second.log.exists()
    assert all(len(lives(run, name)) == 1 for name in ("inv1", "inv3", "plant"))


def test_who_leaves_for_good_is_not_started_again(tmp_path: Path) -> None:
    """Without a return the run ends well with one process less."""
    run, outcome = run_of(tmp_path, AWAY[:1], "simulated")

    assert outcome.broke == ""
    assert outcome.notes == ()
    assert len(lives(run, "inv2")) == 1
