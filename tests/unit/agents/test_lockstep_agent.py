"""One agent under simulated time: how it gets ready in whatever order things come, and what its ticks wait for."""

from __future__ import annotations

import random
from itertools import permutations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gridpeers.agents.agent import Agent
from gridpeers.agents.agent_config import Control, GraphRule
from gridpeers.netem.schema.netem import Netem
from gridpeers.scenarios.emulation.emulated_links import EmulatedLinks
from gridpeers.scenarios.emulation.link_data import EmulationConfig
from gridpeers.wire.messages import Stop
from tests.toy.toy_configs import agent_config
from tests.unit.agents.lockstep_lab import KEYS, Lab, nameplate, ticking

NAMES = ("inv1", "inv2", "inv3", "inv4")

# ---------------------------------------------------------------- getting ready


def test_a_token_that_was_lost_and_comes_back_must_prove_itself_anew() -> None:
    """A cut link may have lost the subscription."""
    lab = Lab()
    lab.meet("inv2")
    lab.prepare(0, "inv2")
    lab.token("inv2", gone=True)
    lab.token("inv2")
    lab.prepare(1, "inv2")
    lab.take()

    lab.answer("inv2")
    assert lab.take() == [("ask", "inv2")]
    lab.answer("inv2")
    assert lab.take() == [("ready", "1")]


def test_a_prepare_that_comes_again_is_answered_again() -> None:
    """The first `Ready` may be lost; roster and wait stay as they are."""
    lab = Lab()
    lab.meet("inv2")
    lab.prepare(0, "inv2")
    assert lab.take()[-1] == ("ready", "0")
    lab.prepare(0, "inv2")

    assert lab.take() == [("ready", "0")]
    assert lab.node.rejects.counts == {}
    lab.measure(0)
    assert [state.seq for state in lab.decided] == [0]


def test_a_leaving_agent_gets_ready_for_no_roster() -> None:
    """A run breaks before its agents are ready: late answers are no errors."""
    lab = Lab(links=EmulatedLinks("inv1", EmulationConfig(netem=Netem(), microgrids={"inv1": "mg1", "inv2": "mg1"})))
    lab.token("inv2")
    lab.prepare(0, "inv2")
    lab.hear(KEYS.control, Stop(sender="plant", epoch=1, seq=0, t=0.0, reason="inv3 died before the run began"))
    lab.take()
    lab.answer("inv2")
    lab.answer("inv2")
    assert lab.node.rejects.counts == {}
    lab.prepare(1, "inv2")

    assert lab.node.rejects.counts == {"unexpected": 1}
    assert ("ready", "0") not in lab.take()


@pytest.mark.parametrize(("number", "roster", "kind"), [
    (2, {"inv1": "me", "inv2": "inv2"}, "stale"),
    (3, {"inv1": "me"}, "stale"),
    (4, {"inv1": "another"}, "unexpected"),
    (4, {"inv1": "another", "inv2": "b"}, "unexpected"),
])  # fmt: skip
def test_an_old_or_foreign_roster_changes_nothing(number: int, roster: dict[str, str], kind: str) -> None:
    lab = Lab()
    lab.meet("inv2")
    lab.prepare(3, "inv2")
    lab.take()
    lab.prepare(number, **roster)

    assert lab.node.rejects.counts == {kind: 1}
    assert lab.take() == []


@given(st.integers(0, 2**32 - 1), st.sampled_from(["full", "none", "GFM-only", "clustered", "ring"]))
def test_an_agent_gets_ready_for_any_order_of_messages(seed: int, graph: GraphRule) -> None:
    """Tokens, roster and answers in any order give one Ready, after a proof from each neighbour."""
    rng, lab = random.Random(seed), Lab(graph)
    events = [*NAMES[1:], ""]
    rng.shuffle(events)
    asked: list[str] = []
    done: list[tuple[str, str]] = []
    while events or asked:
        if events and (not asked or rng.random() < 0.5):
            name = events.pop()
            lab.token(name) if name else lab.prepare(0, *NAMES[1:])
        else:
            lab.answer(asked.pop(rng.randrange(len(asked))))
        new = lab.take()
        asked += [name for what, name in new if what == "ask"]
        done += new
    rule = Agent(agent_config("inv1", Control(secondary="all", graph=graph)))
    for name in NAMES[1:]:
        rule.meet(nameplate(name))
    neighbours = rule.in_neighbours(NAMES)

    assert done[-1] == ("ready", "0")
    assert done.count(("ready", "0")) == 1
    assert sorted(name for what, name in done if what == "listen") == sorted(neighbours)
    assert [done.count(("ask", name)) for name in NAMES[1:]] == [2 if name in neighbours else 1 for name in NAMES[1:]]


# ---------------------------------------------------------------- ticks


@pytest.mark.parametrize("order", list(permutations(("plant", "inv2", "inv3"))))
def test_a_tick_is_due_after_the_last_message_in_any_order(order: tuple[str, ...]) -> None:
    """Measurement and states come in any order; the tick is due after the last, and `wanted` counts down."""
    lab, wanted = ticking("inv2", "inv3", tick=5), []
    for sender in order:
        assert lab.decided == []
        wanted.append(lab.node.messages_needed)
        lab.measure(5) if sender == "plant" else lab.state(sender, 4)

    assert wanted == [3, 2, 1]
    assert [state.seq for state in lab.decided] == [5]


def test_a_state_that_comes_too_early_is_kept_for_its_tick() -> None:
    """State(1) of a faster neighbour is not used at tick 1, and is at tick 2: the bytes are the same as in order."""
    decided = []
    for early in (True, False):
        lab = ticking("inv2", tick=1)
        lab.state("inv2", int(early), P_set=9e4 + early)
        lab.state("inv2", int(not early), P_set=9e4 + (not early)) if early else lab.measure(1)
        lab.measure(1) if early else lab.state("inv2", 1, P_set=9e4 + 1)
        lab.measure(2)
        decided.append(lab.decided)

    assert [state.seq for state in decided[0]] == [1, 2]
    assert decided[0] == decided[1]


def test_an_agent_off_the_roster_is_not_awaited() -> None:
    """A roster without the agent ends the wait, even while its token is there."""
    lab = ticking("inv2", "inv3", tick=5)
    lab.state("inv2", 4)
    lab.prepare(1, "inv2")
    lab.measure(5)

    assert [state.seq for state in lab.decided] == [5]


def test_a_dead_neighbours_last_value_counts_once_more() -> None:
    """The token of the awaited process ends the wait, not that of another process of the name."""
    lab = ticking("inv2", tick=5)
    lab.measure(5)
    lab.token("inv2", "impostor", gone=True)
    assert lab.decided == []

    lab.token("inv2", gone=True)
    assert [state.seq for state in lab.decided] == [5]
    assert not lab.node.failed


def test_missing_messages_are_named_in_the_order_of_the_neighbours() -> None:
    """First the measurement, then the states, as the error at the deadline names them."""
    lab = ticking("inv2", "inv3", tick=5)
    assert lab.missing == [("Measurement(5)", "plant")]
    lab.measure(5)
    lab.state("inv3", 4)

    assert lab.missing == [("State(4)", "inv2")]
    lab.node.expire(lab.node.deadline or 0.0)
    assert lab.node.failed.startswith("inv1: no State(4) from inv2 within 20 s; last heard of inv2: tick ")


@pytest.mark.parametrize(("k", "kind"), [(4, "stale"), (6, "unexpected")])
def test_a_measurement_of_another_tick_is_refused(k: int, kind: str) -> None:
    """Ticks are granted one by one."""
    lab = ticking("inv2", tick=5)
    lab.measure(k)

    assert lab.node.rejects.counts == {kind: 1}


def test_a_first_measurement_whose_time_is_not_that_of_its_tick_is_refused() -> None:
    """The agent takes its times from the tick, and would send messages beyond the largest time."""
    lab = Lab()
    lab.meet("inv2")
    lab.prepare(0, "inv2")

    lab.measure(2**50, t=0.5)
    assert lab.node.rejects.counts == {"implausible": 1}
    lab.measure(25, t=0.5)
    assert [state.seq for state in lab.decided] == [25]


def test_a_state_of_a_later_tick_is_left_alone() -> None:
    """The others continue without an agent off the roster; the plant's roster may come later."""
    lab = ticking("inv2", tick=5)
    lab.state("inv2", 6)
    lab.measure(5)

    assert lab.node.rejects.counts == {}
    assert lab.missing == [("State(4)", "inv2")]
