"""Each named way with bad links and saturation, against a tick worked out by hand."""

from __future__ import annotations

from functools import partial
from math import exp
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from gridpeers.agents.agent import Agent
from gridpeers.agents.agent_config import Control, DegradedCommunication, Gains
from gridpeers.agents.degraded_communication import IslandDetector, SaturationDetector
from gridpeers.wire.codec import encode
from tests.toy.toy_configs import agent_config
from tests.toy.toy_messages import measurement, state

T, M_P, M_Q, ALPHA = 0.02, 0.01, 0.05, 1.0
KAPPA, K_Q = M_P / Gains().k_p, Gains().k_q
ROSTER = ("inv1", "inv2", "inv3")


def agent(name: str = "inv1", **degraded_communication: Any) -> Agent:
    """An agent of the toy that knows the two others; inv1 is a leader."""
    control = Control(
        secondary="all", graph="full", degraded_communication=DegradedCommunication(**degraded_communication)
    )
    made = Agent(agent_config(name, control))
    for other in ROSTER:
        made.meet(Agent(agent_config(other)).nameplate)
    return made


measured = partial(measurement, island="", roster=ROSTER)


def moved(P_set: float, P_bar: float, rate: float) -> float:
    """P_set (pu) a tick later, at nominal frequency, where `rate` (1/s) is gain times the sum of weights."""
    return P_set + 0.5 * (1.0 - exp(-2.0 * rate * T)) * (P_bar - P_set)


def test_a_neighbour_that_sent_nothing_new_is_skipped() -> None:
    """With "skip" a state counts at one tick; with "hold" at all that follow."""
    skips, holds = agent(stale="skip"), agent()
    for it in (skips, holds):
        it.hear(state("inv2", 0, P_set=80e3))
        it.hear(state("inv3", 0, P_set=60e3))
    first = moved(0.5, 0.7, 2 * KAPPA)
    assert [it.tick(measured(1), ROSTER[1:]).P_set / 1e5 for it in (skips, holds)] == pytest.approx([first, first])
    for it in (skips, holds):
        it.hear(state("inv3", 1, P_set=60e3))

    assert skips.tick(measured(2), ROSTER[1:]).P_set / 1e5 == pytest.approx(moved(first, 0.6, KAPPA), rel=1e-12)
    assert holds.tick(measured(2), ROSTER[1:]).P_set / 1e5 == pytest.approx(moved(first, 0.7, 2 * KAPPA), rel=1e-12)


def test_a_state_that_arrives_on_hold_is_not_new_afterwards() -> None:
    """A tick without the law also uses up the arrived states."""
    it = agent(stale="skip")
    it.hear(state("inv2", 0))
    it.tick(measured(1, grid_connected=True), ROSTER[1:])

    assert it.tick(measured(2), ROSTER[1:]).P_set == pytest.approx(50e3)


def test_a_state_fades_beside_the_usual_age_of_its_own_link() -> None:
    """With "age-weighted" a link that is always 0.1 s late counts in full; one that falls silent fades with T_age."""
    it = agent(stale="age-weighted", T_age=0.1)
    P = 0.5
    for k in range(5, 8):
        it.hear(state("inv2", k - 5, P_set=80e3))
        it.hear(state("inv3", k - 1, P_set=60e3))
        P = moved(P, 0.7, 2 * KAPPA)
        assert it.tick(measured(k), ROSTER[1:]).P_set / 1e5 == pytest.approx(P, rel=1e-12)
    it.hear(state("inv2", 3, P_set=80e3))

    r = exp(-T / 0.1)
    P = moved(P, (0.8 + r * 0.6) / (1 + r), (1 + r) * KAPPA)
    assert it.tick(measured(8), ROSTER[1:]).P_set / 1e5 == pytest.approx(P, rel=1e-12)


def test_a_neighbour_older_than_max_age_is_none() -> None:
    """Beyond max_age it is out of the sums and of the degree; by default the last value counts for ever."""
    for degraded_communication, P_bar, rate in (
        ({}, 0.7, 2 * KAPPA),
        ({"max_age": 0.1}, 0.6, KAPPA),
        ({"max_age": 0.1, "weights": "degree-normalised", "kappa_c": 5.0}, 0.6, 5.0),
    ):
        it = agent(**degraded_communication)
        it.hear(state("inv2", 94, P_set=80e3))
        it.hear(state("inv3", 95, P_set=60e3))  # 0.1 s old

        assert it.tick(measured(100), ROSTER[1:]).P_set / 1e5 == pytest.approx(moved(0.5, P_bar, rate), rel=1e-12)


def test_degree_normalised_weights_have_a_gain_of_their_own() -> None:
    """kappa_c for the mean of the neighbours, kappa for the leader's frequency; a skipped neighbour keeps its place."""
    both = agent(weights="degree-normalised", kappa_c=5.0, beta_c=3.0)
    half = agent(weights="degree-normalised", kappa_c=5.0, beta_c=3.0, stale="skip")
    for it in (both, half):
        it.hear(state("inv2", 0, P_set=80e3, Q=10e3))
        it.hear(state("inv3", 0, P_set=60e3, Q=30e3))
    decided = both.tick(measured(1, f=59.94, V=271.46), ROSTER[1:])
    half.tick(measured(1, P_set=50e3, grid_connected=True), ROSTER[1:])
    half.hear(state("inv2", 1))

    leader = (1.0 - exp(-KAPPA * T)) * 0.001 / M_P
    assert decided.P_set / 1e5 == pytest.approx(moved(0.5, 0.7, 5.0) + leader, rel=1e-12)
    V_set = 1.0 + 0.5 * (1.0 - exp(-2.0 * 3.0 * T / K_Q)) * (M_Q * 0.2 + ALPHA / 3.0 * 0.02)
    assert decided.V_set / 277.0 == pytest.approx(V_set, rel=1e-12)
    assert half.tick(measured(2), ROSTER[1:]).P_set / 1e5 == pytest.approx(moved(0.5, 0.8, 0.5 * 5.0), rel=1e-12)


def overloaded(ticks: int, **degraded_communication: Any) -> list[float]:
    """P_set (pu) of a lone leader that gives 0.9 pu and not more, at 59.88 Hz."""
    it = agent(**degraded_communication)
    P_set, held = [], 90e3
    for k in range(ticks):
        held = it.tick(measured(k, P=90e3, f=59.88, P_set=held)).P_set
        P_set.append(held / 1e5)
    return P_set


def test_without_limits_p_set_winds_up() -> None:
    """With "none", the paper's Remark 2, P_set grows as long as the frequency is low; "clamp" ends it at P_set_max."""
    assert overloaded(200, anti_windup="none")[-1] == pytest.approx(0.9 + 200 * (1 - exp(-KAPPA * T)) * 0.2)
    assert overloaded(200)[-1] == Gains().P_set_max


def test_a_saturated_leader_stops_after_t_sat_and_goes_on_as_a_follower() -> None:
    """With "conditional" it stops integrating the low frequency, and agrees with its neighbours."""
    wide = replace(agent_config("inv1").control.gains, P_set_max=50.0)
    control = Control(
        secondary="all",
        graph="full",
        gains=wide,
        degraded_communication=DegradedCommunication(anti_windup="conditional"),
    )
    it = Agent(agent_config("inv1", control))
    it.meet(Agent(agent_config("inv2")).nameplate)
    P, held = [], 90e3
    for k in range(60):
        held = it.tick(measured(k, P=90e3, f=59.88, P_set=held)).P_set
        P.append(held / 1e5)
    it.hear(state("inv2", 59, P_set=100e3))
    agreed = it.tick(measured(60, P=90e3, f=59.88, P_set=held), ("inv2",)).P_set / 1e5
    down = it.tick(measured(61, P=90e3, f=60.06, P_set=held)).P_set / 1e5

    step = (1 - exp(-KAPPA * T)) * 0.2
    assert P[-1] == pytest.approx(0.9 + 25 * step)  # T_sat is 25 ticks, and the first tick is off already
    assert agreed == pytest.approx(moved(P[-1], 1.0, KAPPA))
    assert down == pytest.approx(agreed - 0.5 * step)


def test_vars_that_do_not_follow_stop_v_set_on_that_side_only() -> None:
    """At its var limit a GFL holds a V_set that would rise, and lets it fall at once."""
    it = agent("inv2", anti_windup="conditional")
    V, held = [], 277.0
    for k in range(60):
        it.hear(state("inv1", k, P_set=50e3, Q=40e3))
        held = it.tick(measured(k, to="inv2", V=260.0, Q=20e3, V_set=held), ("inv1",)).V_set
        V.append(held)
    it.hear(state("inv1", 60, P_set=50e3, Q=0.0))
    falls = it.tick(measured(60, to="inv2", V=260.0, Q=20e3, V_set=held), ("inv1",)).V_set

    assert V[0] < V[24] == V[-1]
    assert falls < V[-1]


@given(st.floats(0.01, 0.4), st.booleans())
def test_a_slow_inverter_is_not_saturated(lag: float, up: bool) -> None:
    """A first-order lag is off its characteristic for seconds, but moves towards it."""
    follows, sign = SaturationDetector(T_sat=0.5), 1 if up else -1
    does = [sign * (1.0 - exp(-k * T / lag)) for k in range(300)]

    assert {follows.saturated_side(float(sign), y, k * T) for k, y in enumerate(does)} == {0}
    assert [follows.saturated_side(2.0 * sign, does[-1], (300 + k) * T) for k in range(27)] == [0] * 25 + [sign] * 2


@pytest.mark.parametrize(
    ("islands", "told", "used"),
    [("switches", ("mg1", False), False), ("frequency", ("", True), True), ("ignored", ("", False), True)],
)
def test_the_island_of_a_state_and_the_use_of_it(islands: Any, told: Any, used: bool) -> None:
    """The own island by name, by angle, or not at all; a neighbour's name of an island counts for the switches only."""
    it = agent(islands=islands)
    it.tick(measured(0, island="mg1"), ("inv2",))
    it.hear(replace(state("inv2", 0), island="mg2"))
    said = it.tick(measured(1, island="mg1"), ("inv2",))

    assert (said.island, said.angle is not None) == told
    assert it.shares_island("inv2") == used
    assert (said.P_set > 50e3) == used
    assert (b"angle" in encode(said)) == told[1]


def test_a_neighbour_out_of_step_is_left_out_until_the_grid_is_back() -> None:
    """At 59 Hz it slips by 0.02 cycles in a period; on the grid all are in step, and the memory is cleared."""
    it, angles = agent(islands="frequency"), IslandDetector(60.0, 0.01)
    shared = []
    for k in range(6):
        grid = k == 5
        angles.sensed(T * k, 59.0)
        it.hear(replace(state("inv2", k), angle=angles.angle))
        it.tick(measured(k, grid_connected=grid), ("inv2",))
        shared.append(it.shares_island("inv2"))

    assert shared == [True, False, False, False, False, True]
