from __future__ import annotations

import pytest

from gridpeers.wire.messages import Waiting
from tests.toy.toy_messages import T_C
from tests.unit.agents.realtime_lab import KEYS, Lab, running


def test_an_agent_whose_plant_is_there_but_mute_begins_again_with_a_new_session() -> None:
    """A half-renewed link after a cut can lose messages for ever; before the first measurement the agent waits."""
    lab = Lab()
    lab.token("plant")
    for _ in range(20):
        lab.go(0.5)
    assert not lab.side.finished

    lab.measure(1)
    lab.go(T_C)
    assert lab.side.phases.now == "running"
    for _ in range(8):
        lab.go(0.5)
    assert not lab.side.finished
    lab.go(0.5)
    assert lab.side.session_broken
    assert lab.side.finished
    assert lab.side.failed == ""


@pytest.mark.parametrize(("roster", "heard", "why"), [
    (("inv1", "inv2", "inv3"), ("inv2",), "the plant hears inv3, but nothing comes from it here"),
    (("inv1", "inv2", "inv7"), ("inv2", "inv3"), "the plant hears inv7, but nothing comes from it here"),
    (("inv2", "inv3"), ("inv2", "inv3"), "the plant is heard, but does not hear this agent"),
])  # fmt: skip
def test_an_agent_that_hears_less_than_the_plant_opens_a_new_session(
    roster: tuple[str, ...], heard: tuple[str, ...], why: str
) -> None:
    """The plant hears a neighbour, met or not, and the agent does not; or the plant does not hear the agent."""
    lab = running("inv2", "inv3")
    k = 0
    while not lab.side.finished and k < 400:
        k += 1
        lab.measure(k, roster=roster)
        for name in heard:
            lab.state(name, k, k * T_C)
        lab.go(T_C)

    assert lab.side.session_broken
    assert lab.said[-1] == f"inv1: {why}; opens a new session"
    assert 3.4 < k * T_C < 4.7


def test_a_neighbour_that_the_plant_does_not_hear_either_is_no_reason_for_a_new_session() -> None:
    """A frozen, dead or waiting neighbour is silent for all agents."""
    lab = running("inv2", "inv3")
    for k in range(1, 400):
        lab.measure(k, roster=("inv1", "inv2"))
        lab.state("inv2", k, k * T_C)
        lab.go(T_C)

    assert not lab.side.finished


def test_an_agent_that_has_lost_its_plant_seeks_it_with_new_sessions_now_and_then() -> None:
    """A half-renewed link can hide a plant; each new session waits twice as long, up to a minute."""
    lab = Lab()
    lab.token("plant")
    lab.measure(1)
    lab.go(T_C)
    lab.token("plant", gone=True)
    lasted = []
    for _ in range(6):
        began = lab.now
        while not lab.side.finished:
            lab.go(0.5)
        lasted.append(lab.now - began)
        lab.side.start(lab.now)

    assert lab.side.phases.now == "seeking"
    assert lasted == pytest.approx([4.5, 7.0, 14.0, 28.0, 56.0, 60.0], abs=1.1)
    assert lab.said[-1] == "inv1: nothing comes from the plant; opens a new session"


def test_a_plant_that_says_it_waits_is_not_silent() -> None:
    """A new plant sends no measurement until all agents are there: they keep their sessions and name the missing."""
    lab = Lab()
    lab.token("plant")
    lab.measure(1)
    lab.go(T_C)
    lab.token("plant", gone=True)
    lab.go(2.0)
    lab.token("plant", epoch=2)
    for _ in range(40):
        lab.hear(KEYS.control, Waiting(sender="plant", epoch=2, seq=0, t=0.0, waits_for=("inv3", "inv4")))
        lab.go(0.5)
    assert not lab.side.finished
    assert lab.status().waits_for == "a measurement of inv1 from the plant, which waits for inv3, inv4"

    for _ in range(9):
        lab.go(0.5)
    assert lab.side.session_broken
