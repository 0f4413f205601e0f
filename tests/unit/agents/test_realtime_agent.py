from __future__ import annotations

from itertools import pairwise

import pytest
from msgspec.structs import replace

from gridpeers.agents.agent_config import DegradedCommunication
from gridpeers.wire.messages import Leave, Stop
from tests.toy.toy_configs import ALL_FULL
from tests.toy.toy_messages import T_C
from tests.unit.agents.realtime_lab import KEYS, Lab, running


def test_it_waits_visibly_for_a_plant_and_joins_when_it_measures() -> None:
    """Seeking, waiting, running: the log has each once, the status the present one; no state goes out before."""
    lab = Lab(deadline=0.0)
    lab.go(0.5)
    first = lab.status()
    lab.token("plant")
    lab.go(0.5)
    second = lab.status()
    assert lab.decided() == []
    lab.now += 0.5
    lab.measure(0, P_set=64.7e3)
    lab.go(0.0)

    assert (first.phase, first.waits_for) == ("seeking", "the plant of run toy")
    assert (second.phase, second.waits_for) == ("waiting", "a measurement of inv1 from the plant")
    assert (lab.status().phase, lab.status().waits_for) == ("running", "")
    assert [state.P_set for state in lab.decided()] == [64.7e3]
    assert len(lab.said) == 2


def test_without_any_plant_it_gives_up_after_the_deadline() -> None:
    """The message names the run and the wait."""
    lab = Lab(deadline=3.0)
    lab.go(2.9)
    assert not lab.side.finished
    lab.go(0.2)

    assert lab.side.finished
    assert lab.side.failed == "inv1: no plant of run toy within 3 s"


def test_ticks_keep_their_schedule_and_missed_ones_are_counted() -> None:
    """Ticks are due n T_c / speed after the middle between two measurements; a late wake makes one tick."""
    lab = running(speed=2.0)
    start = 100.005
    lab.go(0.015)
    assert lab.side.deadline == pytest.approx(start + 0.020)
    lab.go(0.037)

    assert len(lab.decided()) == 2
    assert lab.side.policy.upkeep.missed == 2
    assert lab.side.deadline == pytest.approx(start + 0.050)


def test_a_silent_neighbour_is_out_after_max_age_and_back_with_its_next_state() -> None:
    """Age counts from the arrival on the own clock; a frozen process keeps its token."""
    lab = running("inv2")
    lab.state("inv2", 0)
    lab.measure(1)
    lab.go(T_C)
    pulled = lab.decided()[0].P_set
    for k in range(2, 20):
        lab.measure(k)
        lab.go(T_C)
    aged = lab.decided()
    lab.state("inv2", 1, t=0.38)
    lab.go(T_C)

    assert pulled > 50e3
    steps = [b.P_set - a.P_set for a, b in pairwise(aged)]
    moving = sum(step > 0.0 for step in steps)
    assert 0.25 / T_C - 4 <= moving <= 0.25 / T_C
    assert all(step == 0.0 for step in steps[moving:])
    assert lab.decided()[0].P_set > aged[-1].P_set


@pytest.mark.parametrize(("max_age", "pulls"), [(0.0, False), (0.5, True)])
def test_the_age_at_which_a_state_is_out_is_an_option(max_age: float, pulls: bool) -> None:
    """A state that came 0.3 s ago is out by default, and counts where `max_age` is more."""
    lab = running("inv2", control=replace(ALL_FULL, degraded_communication=DegradedCommunication(max_age=max_age)))
    lab.state("inv2", 0)
    for k in range(1, 16):
        lab.measure(k)
        lab.go(T_C)
    *_, before, last = lab.decided()

    assert (last.P_set > before.P_set) == pulls


def test_a_neighbour_in_another_island_is_left_out() -> None:
    """Its state names its island; the status shows an unused neighbour."""
    lab = running("inv2", "inv3")
    for k in range(1, 30):
        lab.measure(k)
        lab.state("inv2", k, t=k * T_C, island="inv2")
        lab.state("inv3", k, t=k * T_C, P_set=50e3)
        lab.go(T_C)

    assert {state.P_set for state in lab.decided()} == {50e3}
    assert lab.status().neighbours == ("inv2", "inv3")
    assert lab.status().used == ("inv3",)


def test_a_restarted_neighbour_is_heard_again_and_its_ghost_is_not() -> None:
    """A new process counts from 0 again; messages of the former one are dropped."""
    lab = running("inv2")
    lab.state("inv2", 500)
    lab.token("inv2", gone=True)
    lab.token("inv2", "b")
    lab.plate("inv2", "b", life=2)
    lab.state("inv2", 501, P_set=0.0)
    lab.measure(1)
    lab.go(T_C)
    ghost = lab.decided()[0].P_set
    lab.state("inv2", 0, epoch=2)
    lab.measure(2)
    lab.go(T_C)

    assert ghost == 50e3
    assert lab.decided()[0].P_set > 50e3
    assert lab.side.rejects.counts["ghost"] == 1


def test_it_holds_without_measurements_and_restarts_from_the_held_set_points() -> None:
    """No state goes out on old readings; the return starts from the set-points of the measurement."""
    lab = running()
    for k in range(1, 5):
        lab.measure(k, f=59.7)
        lab.go(T_C)
    before = lab.decided()[-1]
    for _ in range(30):
        lab.go(T_C)
    held = lab.decided()
    lab.measure(60, P_set=70e3, f=60.0)
    lab.go(T_C)

    assert len(held) <= 0.25 / T_C
    assert held[-1].P_set > before.P_set
    assert [state.P_set for state in lab.decided()] == [70e3]
    assert [line.split(" at ")[0] for line in lab.said[-2:]] == [
        "inv1: no recent measurement; holds its set-points",
        "inv1: goes on",
    ]


def test_it_survives_the_plants_death_and_follows_the_next_plant() -> None:
    """It decides nothing in between; the new plant begins at t = 0, and messages of the old one are ghosts."""
    lab = running()
    lab.measure(500)
    lab.token("plant", gone=True)
    lab.go(T_C)
    assert lab.decided() == []
    lab.go(0.5)
    assert lab.status().phase == "seeking"
    lab.token("plant", epoch=2)
    lab.measure(0, epoch=2, P_set=33e3)
    lab.measure(501)
    lab.go(T_C)

    assert [state.P_set for state in lab.decided()] == [33e3]
    assert lab.side.rejects.counts["ghost"] == 1


def test_it_leaves_properly() -> None:
    """It sends Leave at SIGTERM or at a Stop, and closes at the answer; a refused agent closes at once."""
    asked, stopped, refused = running(), running(), Lab()
    refused.token("plant")
    asked.side.leave("asked to leave: SIGTERM")
    asked.do()
    stop = Stop(sender="plant", epoch=1, seq=0, t=0.0, reason="inv1 was stopped by command")
    stopped.hear(KEYS.stop_request("inv1", "me"), stop)
    refused.hear(KEYS.stop_request("inv1", "me"), replace(stop, reason="inv1: another agent", refused=True))

    assert [lab.side.finished for lab in (asked, stopped, refused)] == [False, False, True]
    for lab in (asked, stopped):
        lab.go(T_C)
        assert lab.decided()[1:] == []
        lab.hear(KEYS.stop_request("inv1", "me"), replace(stop, reason="inv1 has left"))

    assert asked.side.finished
    assert stopped.side.finished
    assert [lab.side.stopped for lab in (asked, stopped)] == ["asked to leave: SIGTERM", stop.reason]
    assert refused.side.failed == "inv1: another agent"
    leaves = [[m for m in lab.published if isinstance(m, Leave)] for lab in (asked, stopped, refused)]
    assert [len(leave) for leave in leaves] == [1, 1, 0]


def test_an_agent_that_leaves_without_an_answer_closes_after_a_second() -> None:
    """A frozen plant holds it for a second at most; without a plant it closes at once."""
    frozen, alone = running(), Lab()
    frozen.side.leave("asked to leave: SIGTERM")
    alone.side.leave("asked to leave: SIGTERM")
    assert alone.side.finished
    for _ in range(50):
        assert not frozen.side.finished
        frozen.go(T_C)

    assert frozen.side.stopped == "asked to leave: SIGTERM"


def test_a_nameplate_that_does_not_come_is_asked_for_again() -> None:
    """A query can be lost with its link while the token stays; the answer ends the repetition."""
    lab = running()
    lab.token("inv2")
    lab.go(0.5)
    lab.go(0.5)
    lab.plate("inv2")
    lab.go(0.5)

    assert lab.fetched.count(KEYS.nameplate("inv2", "a")) == 3
    assert lab.listened == [KEYS.state("inv2")]


def test_a_message_on_which_the_agent_fails_costs_only_itself() -> None:
    """An error of gridpeers is counted and logged once, with its traceback; the agent continues."""
    lab = running("inv2")

    def broken(*_: object) -> None:
        raise KeyError("\x1b[31m")

    lab.side.routes[KEYS.state("inv2")] = lab.side.routes[KEYS.state("inv2")]._replace(handle=broken)
    for k in range(1, 4):
        lab.state("inv2", k)
    lab.measure(1)
    lab.go(T_C)
    (line,) = lab.side.rejects.take_lines()

    assert lab.side.rejects.counts == {"failed": 3}
    assert "KeyError" in line
    assert "Traceback (most recent call last)" in line
    assert "in broken" in line
    assert "\x1b" not in line
    assert len(lab.decided()) == 1
