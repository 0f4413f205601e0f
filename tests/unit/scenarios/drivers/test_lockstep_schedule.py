"""Agents that leave and join on schedule in simulated time: who is faster must not show, whatever a process takes."""

from __future__ import annotations

import random
from typing import Any, Literal

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gridpeers.agents.agent_config import AgentConfig, Control, GraphRule
from gridpeers.plant.lockstep_plant import LockstepPlant
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.run_request import Outcome
from gridpeers.wire.codec import decode
from gridpeers.wire.messages import Stop
from gridpeers.wire.node import Publish
from tests.toy.toy_configs import Schedule, toy_configs
from tests.toy.toy_links import Links
from tests.toy.toy_plant import ToyPlant

SEEDS = st.integers(0, 2**32 - 1)
AWAY: Schedule = ((0.2, "inv2", "leave"), (0.3, "inv2", "join"))


def configured(
    schedule: Schedule = AWAY, n: int = 4, graph: GraphRule = "full", end: float = 0.4, spares: tuple[str, ...] = ()
) -> tuple[PlantConfig, tuple[AgentConfig, ...]]:
    """Plant and agents of a toy with this schedule."""
    return toy_configs(n, Control(secondary="all", graph=graph), end=end, schedule=schedule, spares=spares)


def in_one_process(*args: Any, **kwargs: Any) -> tuple[Outcome, list[tuple[float, ...]]]:
    """Outcome and rows of the in-process driver."""
    plant, agents = configured(*args, **kwargs)
    rows: list[tuple[float, ...]] = []
    return run_inprocess(plant, agents, lambda message: rows.extend(message.rows), plant=ToyPlant(plant)), rows


@settings(max_examples=5)
@given(SEEDS, st.sampled_from(["full", "none", "GFM-only", "clustered", "ring"]))
def test_who_is_faster_changes_nothing(seed: int, graph: GraphRule) -> None:
    """Leaving and returning gives the same rows and events to the last bit, whoever is heard first."""
    plant, agents = configured(graph=graph)
    run = Links(plant, agents, random.Random(seed))
    run.run()
    outcome, rows = in_one_process(graph=graph)

    assert run.rows == rows
    assert tuple(run.events) == outcome.events
    assert run.plant.outcome == ""
    assert run.plant.reproducible
    assert not run.plant.rejects.counts
    assert not any(agent.rejects.counts for agent in run.agents)


@settings(max_examples=5)
@given(SEEDS, st.integers(0, 40))
def test_a_death_around_a_move_does_not_stall_the_run(seed: int, steps: int) -> None:
    """When another agent dies just as one leaves or joins, the rest go on to the end."""
    plant, agents = configured(n=5)
    run = Links(plant, agents, random.Random(seed))
    run.run(until_tick=14)
    for _ in range(steps):
        run.step()
    run.kill("inv3")
    run.run()

    assert run.plant.outcome == ""
    assert run.rows[-1][0] == 0.4


def test_a_newcomer_that_does_not_come_is_named_by_the_deadline() -> None:
    """The tick is held for the newcomer; who waits in vain says for whom."""
    plant, agents = configured()
    run = Links(plant, agents, random.Random(3))
    run.start = lambda name: None  # type: ignore[method-assign]
    while run.plant.phase != "joining":
        assert run.step()
    assert run.plant.tick == 15
    run.plant.expire(plant.deadline)

    assert "token" in run.plant.outcome
    assert "inv2" in run.plant.outcome


@pytest.mark.parametrize(
    ("move", "said"),
    [
        ((0.2, "inv9", "leave"), 'schedule: no inverter "inv9"; inverters are inv1, inv2'),
        (
            (0.21, "inv2", "leave"),
            "schedule: inv2 must leave at a positive multiple of the control period 0.02 s, got 0.21 s",
        ),
    ],
)
def test_a_move_that_cannot_be_is_refused_at_the_start(
    move: tuple[float, str, Literal["leave", "join"]], said: str
) -> None:
    """An unknown inverter, or a time that is no tick, is told with its value."""
    plant, _ = configured((move,), n=2)

    with pytest.raises(ValueError, match=said):
        LockstepPlant(plant, ToyPlant(plant))


def test_who_comes_before_its_time_is_refused() -> None:
    """An agent of a spare that is to join later is told so when it comes at the start."""
    plant, agents = configured(((0.2, "inv4", "join"),), spares=("inv4",))
    side = LockstepPlant(plant, ToyPlant(plant))
    side.start(0.0)
    side.appeared(side.keys.alive_agent("inv4", "early"), 0.0)
    (stop,) = [decode(action.payload) for action in side.take_actions() if isinstance(action, Publish)]

    assert isinstance(stop, Stop)
    assert stop.refused
    assert "the scenario lets it join later" in stop.reason
    assert len(agents) == 4
