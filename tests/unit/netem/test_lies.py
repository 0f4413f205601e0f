"""Lies of agents: valid messages with false values, the same for every run of one seed."""

from __future__ import annotations

import pytest

from gridpeers.netem.liar import HeardFrom, LieTime, LiveHearing, lies_about
from gridpeers.netem.models.lie import Extreme, Freeze, Lie, Offset, Random, Replay, Scale
from gridpeers.netem.schema.netem import Netem, NodeFault
from gridpeers.wire.codec import decode, encode
from gridpeers.wire.messages import State

LIES: tuple[Lie, ...] = (
    Offset(P_set_W=5e4, Q_var=-1e9, V_set_V=-1e6),
    Scale(P_set=-1e6, V_set=-3.0),
    Freeze(),
    Replay(delay_s=0.3),
    Random(P_set_W=1e11, V_set_V=1e6, Q_var=1.0),
    Extreme(side="alternate"),
    Extreme(side="low"),
)


def state(k: int, sender: str = "inv3") -> State:
    return State(sender=sender, epoch=7, seq=k, t=0.1 * k, P_set=1000.0 * k, V_set=277.0 + k, Q=10.0 * k, island="inv1")


def heard(lie: Lie, receiver: str = "inv1", *, seed: int = 1, since: float = 1.0, until: float = 2.0) -> list[State]:
    """Return the states of inv3 that a receiver hears in ticks 0 to 29."""
    live = LiveHearing(HeardFrom(seed, "inv3", receiver, [LieTime(since, until, "inv3", lie)]))
    return [live.told(state(k)) for k in range(30)]


@pytest.mark.parametrize("lie", LIES, ids=lambda lie: type(lie).__name__)
def test_a_lie_is_a_valid_message_with_the_number_and_time_of_the_true_one(lie: Lie) -> None:
    """A false state decodes and keeps sender, epoch, number, time and island; outside of the lie, states are true."""
    for k, told in enumerate(heard(lie)):
        true = state(k)
        assert decode(encode(told)) == told
        assert (told.sender, told.epoch, told.seq, told.t, told.island) == ("inv3", 7, k, true.t, "inv1")
        assert (told != true) == (10 <= k < 20), k


def test_each_lie_changes_values_as_its_name_says() -> None:
    """Offsets add, factors multiply, a freeze repeats, a replay is late, extremes are the bounds of the fields."""
    assert heard(Offset(P_set_W=5.0, Q_var=2.0))[12].P_set == 12_005.0
    assert heard(Scale(Q=-2.0))[12].Q == -240.0
    assert {told.P_set for told in heard(Freeze())[10:20]} == {9000.0}
    assert [told.Q for told in heard(Replay(delay_s=0.3, of=("Q",)))[10:13]] == [70.0, 80.0, 90.0]
    assert heard(Replay(delay_s=0.3, of=("Q",)))[12].P_set == 12_000.0
    assert [(told.P_set, told.V_set) for told in heard(Extreme(side="alternate"))[10:12]] == [(1e11, 1e6), (-1e11, 0.0)]


def test_only_a_two_faced_random_lie_depends_on_the_receiver() -> None:
    """Otherwise seed and message number alone decide the noise: all neighbours hear the same."""
    plain, faced = Random(P_set_W=1e3), Random(P_set_W=1e3, two_faced=True)
    values = [told.P_set - 1000.0 * k for k, told in enumerate(heard(plain))][10:20]

    assert len(set(values)) == 10
    assert all(abs(value) <= 1e3 for value in values)
    assert heard(plain) == heard(plain, "inv2")
    assert heard(plain) != heard(plain, seed=2)
    assert heard(faced) != heard(faced, "inv2")


def test_neighbours_hear_a_lie_and_the_plant_only_if_the_entry_says_so() -> None:
    """A liar itself hears the true states of an agent in whose name it lies."""
    own = NodeFault(name="inv3", lies=Offset(P_set_W=1.0))
    other = NodeFault(name="inv4", lies=Scale(Q=2.0, in_name_of="inv3", plant=True))
    netem = Netem(nodes=(other, own))

    assert [each.liar for each in lies_about(netem, "inv3", "inv1")] == ["inv3", "inv4"]
    assert [each.liar for each in lies_about(netem, "inv3", "plant")] == ["inv4"]
    assert [each.liar for each in lies_about(netem, "inv3", "inv4")] == ["inv3"]
    assert lies_about(netem, "inv4", "inv1") == ()
