from __future__ import annotations

from itertools import pairwise
from typing import Any

import pytest
from msgspec.structs import replace

from agents.agent import Agent
from agents.freerun import FreeAgent
from tests.toy.toy_configs import agent_config
from wire.actions import Fetch, Listen, Publish, Say
from wire.codec import decode, encode
from wire.keys import Keys
from wire.messages import AgentStatus, Leave, Measurement, Message, State, Stop

KEYS = Keys("toy")
T_C = 0.02


class Lab:
    """inv1 on a fake clock, with everything around it played by the test."""

    def __init__(self, **changes: Any) -> None:
        config = replace(agent_config("inv1"), clock="wall", **changes)
        self.now = 100.0
        self.side = FreeAgent(config, "me")
        self.listened: list[str] = []
        self.fetched: list[str] = []
        self.said: list[str] = []
        self.published: list[Message] = []
        self.side.start(self.now)
        self.do()

    def do(self) -> None:
        """Take the actions."""
        for action in self.side.take_actions():
            if isinstance(action, Publish):
                self.published.append(decode(action.payload))
            elif isinstance(action, Fetch):
                self.fetched.append(action.key)
            elif isinstance(action, Listen):
                self.listened.append(action.key)
            else:
                assert isinstance(action, Say)
                self.said.append(action.text)

    def token(self, name: str, instance: str = "a", *, gone: bool = False) -> None:
        """A token comes or goes; of an agent, its nameplate is answered."""
        key = KEYS.alive_plant if name == "plant" else KEYS.alive_agent(name, instance)
        (self.side.vanished if gone else self.side.appeared)(key, self.now)
        self.do()

    def plate(self, name: str, instance: str = "a", *, life: int = 1) -> None:
        """Answer the query for a nameplate."""
        key = KEYS.nameplate(name, instance)
        assert key in self.fetched
        self.hear(key, replace(Agent(agent_config(name)).nameplate, incarnation=life))

    def hear(self, key: str, message: Message) -> None:
        """A message comes in."""
        self.side.received(key, encode(message), self.now)
        self.do()

    def meet(self, *names: str) -> None:
        """Agents are there, and known."""
        for name in names:
            self.token(name)
            self.plate(name)

    def measure(self, k: int, **changes: Any) -> None:
        """The plant's measurement of tick k comes in."""
        values: dict[str, Any] = dict(
            sender="plant", incarnation=1, seq=k, t=round(k * T_C, 9), to="inv1", P=50e3, Q=0.0, V=277.0, f=60.0,
            P_set=50e3, V_set=277.0, grid_connected=False, island="inv1", roster=(),
        )  # fmt: skip
        self.hear(KEYS.measurement("inv1"), Measurement(**values | changes))

    def state(self, name: str, seq: int, t: float = 0.0, **changes: Any) -> None:
        """A neighbour's state comes in."""
        values: dict[str, Any] = dict(
            sender=name, incarnation=1, seq=seq, t=t, P_set=80e3, V_set=277.0, Q=0.0, island="inv1"
        )
        self.hear(KEYS.state(name), State(**values | changes))

    def go(self, seconds: float) -> None:
        """Time passes; the agent is woken only now."""
        self.now += seconds + 1e-9  # sums of periods are not to fall short of their products
        self.side.expire(self.now)
        self.do()

    def decided(self) -> list[State]:
        """States published since last asked."""
        states = [message for message in self.published if isinstance(message, State)]
        self.published = [message for message in self.published if not isinstance(message, State)]
        return states

    def status(self) -> AgentStatus:
        """The latest status."""
        return [message for message in self.published if isinstance(message, AgentStatus)][-1]


def running(*neighbours: str, **changes: Any) -> Lab:
    """An agent that ticks, with these neighbours."""
    lab = Lab(**changes)
    lab.token("plant")
    lab.meet(*neighbours)
    lab.measure(0)
    lab.go(0.0)
    assert len(lab.decided()) == 1
    return lab


def test_it_waits_visibly_for_a_plant_and_joins_when_it_measures() -> None:
    """Seeking, waiting, running: each is said once and stands in the status; no state is sent before."""
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
    """The message says which run was sought and how long."""
    lab = Lab(deadline=3.0)
    lab.go(2.9)
    assert not lab.side.over
    lab.go(0.2)

    assert lab.side.over
    assert lab.side.failed == "inv1: no plant of run toy within 3 s"


def test_ticks_keep_their_schedule_and_missed_ones_are_counted() -> None:
    """Due times are n T_c / speed from the middle between two measurements; a late wake does one tick, not many."""
    lab = running(speed=2.0)
    start = 100.005
    lab.go(0.015)
    assert lab.side.until == pytest.approx(start + 0.020)
    lab.go(0.037)

    assert len(lab.decided()) == 2
    assert lab.side.missed == 2
    assert lab.side.until == pytest.approx(start + 0.050)


def test_a_silent_neighbour_is_out_after_max_age_and_back_with_its_next_state() -> None:
    """Age counts from the arrival, on the own clock; a frozen process keeps its token."""
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


def test_a_state_that_was_long_on_its_way_is_old_when_it_comes() -> None:
    """After a cut, buffered states arrive in a bunch: their run time tells."""
    lab = running("inv2")
    lab.measure(100)
    lab.state("inv2", 7, t=1.0)
    lab.go(T_C)

    assert lab.decided()[0].P_set == 50e3


def test_a_neighbour_in_another_island_is_left_out() -> None:
    """Its state says where it stands; the status shows it as a neighbour that is not used."""
    lab = running("inv2", "inv3")
    for k in range(1, 30):
        lab.measure(k)
        lab.state("inv2", k, t=k * T_C, island="inv2")
        lab.state("inv3", k, t=k * T_C, P_set=50e3)
        lab.go(T_C)

    assert {state.P_set for state in lab.decided()} == {50e3}
    assert lab.status().neighbours == ("inv2", "inv3")
    assert lab.status().used == ("inv3",)


def test_a_lost_token_takes_a_neighbour_out_at_once() -> None:
    """Leaving and dying are seen alike."""
    lab = running("inv2")
    lab.state("inv2", 0)
    lab.token("inv2", gone=True)
    lab.measure(1)
    lab.go(T_C)

    assert lab.decided()[0].P_set == 50e3


def test_a_restarted_neighbour_is_heard_again_and_its_ghost_is_not() -> None:
    """A new process counts from 0 again; what its former life still sends is dropped."""
    lab = running("inv2")
    lab.state("inv2", 500)
    lab.token("inv2", gone=True)
    lab.token("inv2", "b")
    lab.plate("inv2", "b", life=2)
    lab.state("inv2", 501, P_set=0.0)
    lab.measure(1)
    lab.go(T_C)
    ghost = lab.decided()[0].P_set
    lab.state("inv2", 0, incarnation=2)
    lab.measure(2)
    lab.go(T_C)

    assert ghost == 50e3
    assert lab.decided()[0].P_set > 50e3
    assert lab.side.rejects.counts["ghost"] == 1


def test_a_second_process_of_a_name_waits_until_the_first_is_gone() -> None:
    """Somebody that only claims a neighbour's name does not push it out."""
    lab = running("inv2")
    lab.token("inv2", "b")
    assert KEYS.nameplate("inv2", "b") not in lab.fetched
    lab.state("inv2", 0)
    lab.measure(1)
    lab.go(T_C)
    assert lab.decided()[0].P_set > 50e3
    lab.token("inv2", "a", gone=True)

    assert KEYS.nameplate("inv2", "b") in lab.fetched


def test_it_holds_while_no_measurement_comes_and_returns_from_what_the_plant_holds() -> None:
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


def test_it_survives_the_plants_death_and_follows_its_new_life() -> None:
    """Nothing is decided between; the new plant begins at t = 0 with other set-points, the old one is a ghost."""
    lab = running()
    lab.measure(500)
    lab.token("plant", gone=True)
    lab.go(T_C)
    assert lab.decided() == []
    lab.go(0.5)
    assert lab.status().phase == "seeking"
    lab.token("plant")
    lab.measure(0, incarnation=2, P_set=33e3)
    lab.measure(501)
    lab.go(T_C)

    assert [state.P_set for state in lab.decided()] == [33e3]
    assert lab.side.rejects.counts["ghost"] == 1


def test_woken_late_it_drops_what_it_knew() -> None:
    """After SIGCONT what lies in the inbox is seconds old, though it comes in now."""
    lab = running("inv2")
    lab.now += 3.0
    lab.measure(1)
    lab.state("inv2", 0)
    lab.go(0.0)
    assert lab.decided() == []
    lab.measure(160, P_set=61e3)
    lab.go(T_C)

    assert [state.P_set for state in lab.decided()] == [61e3]


def test_it_leaves_properly() -> None:
    """Leave goes out, of itself or at the plant's word; it closes when the plant answers; refused, it just closes."""
    asked, stopped, refused = running(), running(), Lab()
    asked.side.leave("asked to leave: SIGTERM")
    asked.do()
    stop = Stop(sender="plant", incarnation=1, seq=0, t=0.0, reason="inv1 was stopped by command")
    stopped.hear(KEYS.dismissal("inv1", "me"), stop)
    refused.hear(KEYS.dismissal("inv1", "me"), replace(stop, reason="inv1: another agent", refused=True))

    assert [lab.side.over for lab in (asked, stopped, refused)] == [False, False, True]
    for lab in (asked, stopped):
        lab.go(T_C)
        assert lab.decided()[1:] == []
        lab.hear(KEYS.dismissal("inv1", "me"), replace(stop, reason="inv1 has left"))

    assert asked.side.over
    assert stopped.side.over
    assert [lab.side.stopped for lab in (asked, stopped)] == ["asked to leave: SIGTERM", stop.reason]
    assert refused.side.failed == "inv1: another agent"
    leaves = [[m for m in lab.published if isinstance(m, Leave)] for lab in (asked, stopped, refused)]
    assert [len(leave) for leave in leaves] == [1, 1, 0]


def test_who_leaves_and_is_not_answered_closes_after_a_second() -> None:
    """A plant that is frozen keeps nobody; where there is none, nothing is waited for."""
    frozen, alone = running(), Lab()
    frozen.side.leave("asked to leave: SIGTERM")
    alone.side.leave("asked to leave: SIGTERM")
    assert alone.side.over
    for _ in range(50):
        assert not frozen.side.over
        frozen.go(T_C)

    assert frozen.side.stopped == "asked to leave: SIGTERM"


def test_gaps_in_the_numbers_are_counted_as_lost() -> None:
    """Zenoh drops silently; the numbers tell."""
    lab = running("inv2")
    for seq in (0, 1, 4):
        lab.state("inv2", seq)
    lab.measure(3)

    assert lab.side._heard.lost == 2 + 2


def test_an_agent_whose_plant_is_there_but_mute_begins_again_with_a_new_session() -> None:
    """A link half renewed after a cut can mislead messages for good; before the first measurement one waits."""
    lab = Lab()
    lab.token("plant")
    for _ in range(20):
        lab.go(0.5)
    assert not lab.side.over

    lab.measure(1)
    lab.go(T_C)
    assert lab.side.phase == "running"
    for _ in range(8):
        lab.go(0.5)
    assert not lab.side.over
    lab.go(0.5)
    assert lab.side.astray
    assert lab.side.over
    assert lab.side.failed == ""


def test_messages_under_others_keys_prove_a_confused_session() -> None:
    """A few strays are counted; many mean that key numbers are confused, and the agent begins again."""
    lab = running("inv2")
    measurement = Measurement(
        sender="plant", incarnation=1, seq=9, t=0.2, to="inv1", P=0.0, Q=0.0, V=277.0, f=60.0, P_set=0.0, V_set=277.0,
        grid_connected=False, island="inv1", roster=(),
    )  # fmt: skip
    for _ in range(9):
        lab.hear(KEYS.state("inv2"), measurement)
    assert not lab.side.over

    lab.hear(KEYS.state("inv2"), measurement)

    assert lab.side.astray
    assert lab.said[-1] == "inv1: messages of plant come under the key of inv2; opens a new session"


@pytest.mark.parametrize(
    ("roster", "heard", "why"),
    [
        (("inv1", "inv2", "inv3"), ("inv2",), "the plant hears inv3, but nothing comes from it here"),
        (("inv1", "inv2", "inv7"), ("inv2", "inv3"), "the plant hears inv7, but nothing comes from it here"),
        (("inv2", "inv3"), ("inv2", "inv3"), "the plant is heard, but does not hear this agent"),
    ],
)
def test_whoever_hears_less_than_the_plant_opens_a_new_session(
    roster: tuple[str, ...], heard: tuple[str, ...], why: str
) -> None:
    """The plant hears a neighbour, met or not, and the agent does not; or the plant does not hear the agent."""
    lab = running("inv2", "inv3")
    k = 0
    while not lab.side.over and k < 400:
        k += 1
        lab.measure(k, roster=roster)
        for name in heard:
            lab.state(name, k, k * T_C)
        lab.go(T_C)

    assert lab.side.astray
    assert lab.said[-1] == f"inv1: {why}; opens a new session"
    assert 3.4 < k * T_C < 4.7


def test_a_neighbour_that_the_plant_does_not_hear_either_is_no_reason_for_a_new_session() -> None:
    """Who is frozen, dead or waiting is silent for everybody."""
    lab = running("inv2", "inv3")
    for k in range(1, 400):
        lab.measure(k, roster=("inv1", "inv2"))
        lab.state("inv2", k, k * T_C)
        lab.go(T_C)

    assert not lab.side.over


def test_an_agent_that_has_lost_its_plant_seeks_it_with_new_sessions_now_and_then() -> None:
    """A half renewed link can hide a plant that is there; each new session is given twice the time, up to a minute."""
    lab = Lab()
    lab.token("plant")
    lab.measure(1)
    lab.go(T_C)
    lab.token("plant", gone=True)
    lasted = []
    for _ in range(6):
        began = lab.now
        while not lab.side.over:
            lab.go(0.5)
        lasted.append(lab.now - began)
        lab.side.start(lab.now)

    assert lab.side.phase == "seeking"
    assert lasted == pytest.approx([4.5, 7.0, 14.0, 28.0, 56.0, 60.0], abs=1.1)
    assert lab.said[-1] == "inv1: nothing comes from the plant; opens a new session"


def test_a_session_that_once_was_whole_is_no_reason_for_more_patience() -> None:
    """Every cut that heals badly is mended as soon as the first; nothing is remembered of those that were mended."""
    lab = running("inv2")
    k, lasted = 0, []
    for _ in range(4):
        lab.token("plant")
        lab.meet("inv2")
        for _ in range(10):
            k += 1
            lab.measure(k, roster=("inv1", "inv2"))
            lab.state("inv2", k, k * T_C)
            lab.go(T_C)
        began = lab.now
        while not lab.side.over:
            lab.go(T_C)
        lasted.append(lab.now - began)
        lab.side.start(lab.now)

    assert lasted == pytest.approx([4.5] * 4, abs=0.1)


def test_an_agent_that_has_never_had_a_plant_keeps_its_session() -> None:
    """Nothing says that one is there."""
    lab = Lab()
    for _ in range(20):
        lab.go(0.5)

    assert not lab.side.astray


def test_a_nameplate_that_does_not_come_is_asked_for_again() -> None:
    """A question can die with the link it went over, though the other's token stays; the answer ends the asking."""
    lab = running()
    lab.token("inv2")
    lab.go(0.5)
    lab.go(0.5)
    lab.plate("inv2")
    lab.go(0.5)

    assert lab.fetched.count(KEYS.nameplate("inv2", "a")) == 3
    assert lab.listened == [KEYS.state("inv2")]
