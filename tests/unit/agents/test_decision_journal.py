"""What an agent notes about how it decides."""

from __future__ import annotations

from math import inf
from types import SimpleNamespace
from typing import Any, cast

import pytest

from gridpeers.agents.agent import Agent
from gridpeers.agents.decision_journal import DecisionJournal
from gridpeers.scenarios.record.journal_reader import entries_of
from gridpeers.wire.journal import Decision, JournalBuffer

NEIGHBOURS = ("inv2", "inv3", "inv4", "inv5")


class Deciding:
    """An agent as its decision journal sees it."""

    def __init__(self, *, weighs_alike: bool = True) -> None:
        self.weighs_alike = weighs_alike
        self.heard: dict[str, Any] = {}
        self.around: list[Any] = []
        self.saturated = (0, 0)
        self.in_service = True
        self.here = set(NEIGHBOURS)
        self.journal = DecisionJournal(cast(Agent, self), JournalBuffer())

    def shares_island(self, name: str) -> bool:
        return name in self.here

    def hear(self, number: int, *names: str) -> None:
        self.heard |= {name: SimpleNamespace(seq=number) for name in names}

    def use(self, *names: str, weight: float = 1.0) -> None:
        self.around = [SimpleNamespace(name=name, weight=weight) for name in names]

    def noted(self) -> list[Decision]:
        entries = [entry for part in self.journal.journal.take_parts() for entry in entries_of(part)]
        return [entry for entry in entries if isinstance(entry, Decision)]


@pytest.mark.parametrize("what", ["older", "measurement", "saturated", "fewer", "another"])
def test_in_ticks_each_change_is_noted(what: str) -> None:
    """An older state, a late measurement, a saturated side, a neighbour less, another neighbour."""
    agent = Deciding()
    agent.hear(0, *NEIGHBOURS)
    agent.use(*NEIGHBOURS)
    agent.journal.tick(1, 0, NEIGHBOURS)
    agent.noted()
    agent.hear(1, *(NEIGHBOURS[:-1] if what == "older" else NEIGHBOURS), "inv6")
    if what == "saturated":
        agent.saturated = (1, 0)
    names = {"fewer": NEIGHBOURS[:-1], "another": (*NEIGHBOURS[:-1], "inv6")}.get(what, NEIGHBOURS)
    agent.use(*names)

    assert agent.journal.tick(2, 1 if what == "measurement" else 0, names)

    (entry,) = agent.noted()
    assert (entry.states, entry.measurement, entry.saturated, entry.neighbours) == (
        [1, 1, 1, 2] if what == "older" else [1] * len(names),
        1 if what == "measurement" else 0,
        agent.saturated,
        list(names),
    )


def test_in_real_time_each_decision_is_noted_with_its_reasons() -> None:
    """Ages show silent and stale neighbours; a young state outside the sums is of another island."""
    agent = Deciding()
    agent.hear(7, "inv2", "inv4", "inv5")
    agent.use("inv2")
    ages = {"inv2": 0.01, "inv3": inf, "inv4": 0.3, "inv5": 0.25}

    agent.journal.realtime_tick(9, 11, ages, 0.25, 1000.5, (5e4, 277.0))
    agent.journal.realtime_tick(10, 12, {"inv2": 0.02}, 0.25, 1000.52, None)

    first, second = agent.noted()
    assert (first.tick, first.measurement, first.at, first.before) == (9, 11, 1000.5, [5e4, 277.0])
    assert first.states == [7, None, 7, 7]
    assert first.unused == ["", "silent", "stale", "island"]
    assert first.ages == [0.01, None, 0.3, 0.25]
    assert (second.neighbours, second.unused, second.before, second.weights) == (["inv2"], [], [], [])


@pytest.mark.parametrize("realtime", [False, True])
def test_weights_are_noted_of_all_neighbours(realtime: bool) -> None:
    """Also where all are 1 now: under such options they change from one decision to the next."""
    agent = Deciding(weighs_alike=False)
    agent.hear(4, *NEIGHBOURS)
    agent.use("inv2", "inv4", weight=0.5)

    if realtime:
        agent.journal.realtime_tick(5, 5, dict.fromkeys(NEIGHBOURS, 0.02), 0.25, 1000.0, None)
    else:
        agent.journal.tick(5, 0, NEIGHBOURS)

    (entry,) = agent.noted()
    assert entry.weights == [0.5, 0.0, 0.5, 0.0]
