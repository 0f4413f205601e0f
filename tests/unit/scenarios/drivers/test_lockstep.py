"""Whole runs in simulated time: who is faster and who dies when must not matter."""

from __future__ import annotations

import random
from typing import Literal

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gridpeers.agents.agent_config import AgentConfig, Control, GraphRule
from gridpeers.agents.agent_node import AgentNode
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_node import PlantNode
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from tests.toy.toy_configs import Schedule, agent_config, toy_configs
from tests.toy.toy_links import Links
from tests.toy.toy_plant import ToyPlant

SEEDS = st.integers(0, 2**32 - 1)
AWAY: Schedule = ((0.2, "inv2", "leave"), (0.3, "inv2", "join"))
SCHEDULES = st.sampled_from([(), AWAY])


def configured(
    schedule: Schedule = (), n: int = 4, graph: GraphRule = "full", end: float = 0.4
) -> tuple[PlantConfig, tuple[AgentConfig, ...]]:
    return toy_configs(n, Control(secondary="all", graph=graph), end=end, schedule=schedule)


def links(seed: int = 0, schedule: Schedule = (), n: int = 4, graph: GraphRule = "full", end: float = 0.4) -> Links:
    """A short run; the seed draws who is faster."""
    return Links(*configured(schedule, n, graph, end), random.Random(seed))


@settings(max_examples=15)
@given(SEEDS, SCHEDULES, st.sampled_from(["full", "none", "GFM-only", "clustered", "ring"]))
def test_who_is_faster_changes_nothing(seed: int, schedule: Schedule, graph: GraphRule) -> None:
    """Rows and events are those of one process to the last bit, whoever is heard first; also as agents come and go."""
    run = links(seed, schedule, graph=graph)
    run.run()
    plant, agents = configured(schedule, graph=graph)
    rows: list[tuple[float, ...]] = []
    outcome = run_inprocess(plant, agents, lambda message: rows.extend(message.rows), plant=ToyPlant(plant))

    assert run.rows == rows
    assert tuple(run.events) == outcome.events
    assert run.plant.stepper.outcome == ""
    assert run.plant.stepper.reproducible
    assert not run.plant.rejects.counts
    assert not any(agent.rejects.counts for agent in run.agents)


@settings(max_examples=15)
@given(SEEDS, SCHEDULES, st.integers(0, 180), st.sampled_from(["full", "ring", "clustered"]))
def test_the_run_survives_any_death_at_any_moment(seed: int, schedule: Schedule, steps: int, graph: GraphRule) -> None:
    """An agent that dies once ticks have begun is taken off the roster, which is said; the others go on to the end."""
    run = links(seed, schedule, n=5, graph=graph)
    while not run.telemetry:
        assert run.step()
    for _ in range(steps):
        run.step()
    run.kill("inv3")
    run.run()
    deaths = [event for event in run.events if event.kind == "roster" and event.subject == "inv3"]

    assert run.plant.stepper.outcome == ""
    assert run.rows[-1][0] == 0.4
    if deaths:  # else it had left at the end already
        assert not run.plant.stepper.reproducible
        assert f"inv3 died at t = {deaths[0].t:g} s; its inverter stays on primary droop" in deaths[0].text


def test_the_dead_are_not_listened_to() -> None:
    """The others restore the frequency and agree without inv2; its inverter keeps its last set-points."""
    run = links(end=4.0)
    run.run(until_tick=8)
    run.kill("inv2")
    run.run()
    f = run.rows[-1][1::6]
    P_set = run.rows[-1][5::6]

    assert f == pytest.approx([60.0] * 4, abs=1e-3)
    assert P_set[0] == pytest.approx(P_set[2], rel=1e-3)
    assert P_set[0] == pytest.approx(P_set[3], rel=1e-3)
    assert P_set[1] == run.rows[12][11]


def test_who_dies_before_the_start_breaks_the_run() -> None:
    """A run that begins without one of its agents would be another run."""
    run = links(n=3)
    while run.plant.phase == "gathering":
        run.step()
    run.kill("inv2")
    run.run()

    assert run.plant.stepper.outcome == "inv2 died before the run began"
    assert run.telemetry[-1].final
    assert run.telemetry[-1].outcome == run.plant.stepper.outcome
    assert not run.agents


def test_telemetry_comes_at_once_and_then_in_batches() -> None:
    """The first row comes before the first tick, then ten ticks at a time, and the last message says that it is."""
    run = links(end=0.5)
    run.run()

    assert [len(message.rows) for message in run.telemetry] == [1, 10, 10, 5]
    assert [message.final for message in run.telemetry] == [False, False, False, True]
    assert [message.seq for message in run.telemetry] == [0, 1, 2, 3]


def test_an_agent_without_a_plant_says_so() -> None:
    """It waits twice the deadline, so that a plant would complain first."""
    agent = AgentNode(agent_config("inv1"), "a")
    agent.start(0.0)
    agent.expire(19.9)
    assert not agent.finished
    agent.expire(20.0)

    assert agent.failed == "inv1: no sign of life from plant within 20 s; nothing was ever heard from plant"


@pytest.mark.parametrize(("move", "said"), [
    ((0.2, "inv9", "leave"), 'schedule: no inverter "inv9"; inverters are inv1, inv2'),
    (
        (0.21, "inv2", "leave"),
        "schedule: inv2 must leave at a positive multiple of the control period 0.02 s, got 0.21 s",
    ),
    (None, 'agents: no inverter "inv3"; inverters are inv1, inv2'),
])  # fmt: skip
def test_what_cannot_be_is_refused_at_the_start(
    move: tuple[float, str, Literal["leave", "join"]] | None, said: str
) -> None:
    """An unknown inverter, or a time that is no tick, is told with its value."""
    plant, _ = configured((move,) if move else (), n=2)
    config = plant if move else msgspec.structs.replace(plant, agents=("inv1", "inv3"))

    with pytest.raises(ValueError, match=said):
        PlantNode(config, ToyPlant(plant))
