"""One agent in simulated time, its plant and its neighbour played by hand."""

from __future__ import annotations

from agents.lockstep import AgentSide
from tests.toy.toy_configs import agent_config
from wire.codec import encode
from wire.messages import Measurement, Prepare, State


def two_agents() -> tuple[AgentSide, list[bytes]]:
    """inv1 with inv2 as its neighbour, at tick 1 and waiting; and the plant's measurements of ticks 0 to 2."""
    agent, keys = AgentSide(agent_config("inv1"), "a"), AgentSide(agent_config("inv1"), "a").keys
    other = AgentSide(agent_config("inv2"), "b")
    agent.start(0.0)
    agent.appeared(keys.alive_plant(1), 0.0)
    agent.appeared(other.token, 0.0)
    agent.received(*other.nameplate, 0.0)
    agent.received(*other.nameplate, 0.0)
    prepare = Prepare(sender="plant", incarnation=1, seq=0, t=0.0, roster=("inv1", "inv2"), instances=("a", "b"))
    agent.received(keys.control, encode(prepare), 0.0)
    grants = [
        encode(
            Measurement(
                sender="plant", incarnation=1, seq=k, t=0.02 * k, to="inv1", P=5e4, Q=0.0, V=277.0, f=59.9,
                P_set=5e4, V_set=277.0, grid_connected=False, island="inv1", roster=("inv1", "inv2"),
            )
        )
        for k in range(3)
    ]  # fmt: skip
    agent.received(keys.measurement("inv1"), grants[0], 1.0)
    agent.take_actions()
    return agent, grants


def neighbour_state(k: int, P_set: float = 9e4) -> bytes:
    """State of inv2 at tick k."""
    return encode(State(sender="inv2", incarnation=1, seq=k, t=0.02 * k, P_set=P_set, V_set=277.0, Q=0.0))


def test_an_agent_waits_for_its_neighbours_state_of_the_tick_before() -> None:
    """The measurement alone is not enough, and the deadline names the neighbour."""
    agent, grants = two_agents()
    agent.received(agent.keys.measurement("inv1"), grants[1], 2.0)

    assert agent.take_actions() == []
    agent.expire(22.0)
    assert agent.failed == "inv1: no State(0) from inv2 within 20 s; last heard of inv2: tick 0, 22.0 s ago"


def test_a_state_that_comes_too_early_is_kept_back() -> None:
    """State(1) of a faster neighbour is not used at tick 1, and is at tick 2."""
    decided = []
    for early in (True, False):
        agent, grants = two_agents()
        first, second = (0, 1) if early else (1, 0)
        order: list[tuple[str, bytes]] = [(agent.keys.state("inv2"), neighbour_state(k)) for k in (0, 1)]
        grant = (agent.keys.measurement("inv1"), grants[1])
        for message in (order[first], order[second], grant) if early else (order[0], grant, order[1]):
            agent.received(*message, 2.0)
        agent.received(agent.keys.measurement("inv1"), grants[2], 3.0)
        decided.append([action[1] for action in agent.take_actions()])
        assert second != first

    assert len(decided[0]) == 2
    assert decided[0] == decided[1]


def test_a_dead_neighbours_last_value_counts_once_more() -> None:
    """The wait ends with the token; what was last heard is used."""
    agent, grants = two_agents()
    agent.received(agent.keys.measurement("inv1"), grants[1], 2.0)
    agent.vanished(agent.keys.alive_agent("inv2", "b"), 2.1)

    assert len(agent.take_actions()) == 1
    assert not agent.failed


def test_the_token_of_another_instance_does_not_end_a_wait() -> None:
    """A refused namesake that leaves is not the neighbour that is awaited."""
    agent, grants = two_agents()
    agent.received(agent.keys.measurement("inv1"), grants[1], 2.0)
    agent.vanished(agent.keys.alive_agent("inv2", "impostor"), 2.1)

    assert agent.take_actions() == []
