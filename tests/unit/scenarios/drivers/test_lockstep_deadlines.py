"""Who waits in vain in simulated time says for whom, and how long."""

from __future__ import annotations

import random

import msgspec

from gridpeers.agents.lockstep_agent import LockstepAgent
from gridpeers.plant.lockstep_plant import LockstepPlant
from gridpeers.wire.codec import encode
from gridpeers.wire.messages import State
from tests.toy.toy_configs import agent_config, toy_configs
from tests.toy.toy_links import Links
from tests.toy.toy_plant import ToyPlant


def started(n: int = 2) -> LockstepPlant:
    """A plant that has sent Measurement(0), and heard nothing since."""
    run = Links(*toy_configs(n), random.Random(0))
    while run.plant.phase != "ticking":
        run.step()
    return run.plant


def test_the_plants_deadline_names_who_is_missing() -> None:
    """The error names the agent, the missing message, the last tick and the last sign of life."""
    plant = started()
    state = State(sender="inv1", epoch=1, seq=0, t=0.0, P_set=5e4, V_set=277.0, Q=0.0)
    plant.received(plant.keys.state("inv1"), encode(state), 3.0)

    plant.expire(9.9)
    assert plant.outcome == ""
    plant.expire(10.5)

    assert plant.outcome == "plant: no State(0) from inv2 within 10 s; last heard of inv2: tick 0, 10.5 s ago"
    assert plant.phase == "closing"


def test_the_plant_says_whom_it_waits_for_before_the_start() -> None:
    """Agents that never came are named."""
    config, _ = toy_configs(2)
    plant = LockstepPlant(config, ToyPlant(config))
    plant.start(100.0)
    plant.appeared(plant.keys.alive_agent("inv2", "a"), 101.0)

    plant.expire(110.0)

    assert plant.outcome == (
        "plant: no token from inv1 within 10 s; nothing was ever heard from inv1. "
        "no nameplate from inv2 within 10 s; nothing was ever heard from inv2"
    )


def test_an_agent_without_a_plant_says_so() -> None:
    """It waits twice the deadline, so that a plant would complain first."""
    agent = LockstepAgent(agent_config("inv1"), "a")
    agent.start(0.0)
    agent.expire(19.9)
    assert not agent.finished
    agent.expire(20.0)

    assert agent.failed == "inv1: no sign of life from plant within 20 s; nothing was ever heard from plant"


def test_a_plant_that_is_built_slowly_is_waited_for() -> None:
    """On a slow computer the first compilation takes longer than any message may: only the first wait is longer."""
    agent = LockstepAgent(msgspec.structs.replace(agent_config("inv1"), plant_wait=600.0), "a")
    agent.start(0.0)
    agent.expire(599.9)

    assert not agent.finished
    agent.expire(600.0)
    assert agent.failed.startswith("inv1: no sign of life from plant within ")


def test_a_plant_that_still_compiles_is_waited_for() -> None:
    """Once its token is seen there is no deadline until it calls; its death ends the wait."""
    agent = LockstepAgent(agent_config("inv1"), "a")
    agent.start(0.0)
    agent.appeared(agent.keys.alive_plant(1), 1.0)

    assert agent.deadline is None
    agent.vanished(agent.keys.alive_plant(1), 2.0)
    assert agent.failed == "inv1: the plant is gone; the run has ended"
