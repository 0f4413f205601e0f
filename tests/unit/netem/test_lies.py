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
    """Return what a receiver hears of inv3 in ticks 0 to 29."""
    live = LiveHearing(HeardFrom(seed, "inv3", receiver, [LieTime(since, until, "inv3", lie)]))
    return [live.told(state(k)) for k in range(30)]


@pytest.mark.parametrize("lie", LIES, ids=lambda lie: type(lie).__name__)
def test_a_lie_is_a_valid_message_with_the_number_and_time_of_the_true_one(lie: Lie) -> None:
    """What is heard decodes, keeps sender, epoch, number, time and island, and is true outside of its time."""
    for k, told in enumerate(heard(lie)):
        true = state(k)
        assert decode(encode(told)) == told
        assert (told.sender, told.epoch, told.seq, told.t, told.island) == ("inv3", 7, k, true.t, "inv1")
        assert (told != true) == (10 <= k < 20), k


def test_each_lie_says_what_its_name_says() -> None:
    """Offsets add, factors multiply, a freeze stays, a replay is late, extremes are the bounds of the fields."""
    assert heard(Offset(P_set_W=5.0, Q_var=2.0))[12].P_set == 12_005.0
    assert heard(Scale(Q=-2.0))[12].Q == -240.0
    assert {told.P_set for told in heard(Freeze())[10:20]} == {9000.0}
    assert [told.Q for told in heard(Replay(delay_s=0.3, of=("Q",)))[10:13]] == [70.0, 80.0, 90.0]
    assert heard(Replay(delay_s=0.3, of=("Q",)))[12].P_set == 12_000.0
    assert [(told.P_set, told.V_set) for told in heard(Extreme(side="alternate"))[10:12]] == [(1e11, 1e6), (-1e11, 0.0)]


def test_random_lies_depend_on_seed_and_number_and_only_the_two_faced_on_who_hears() -> None:
    """All neighbours hear the same noise of one seed, unless the liar is two-faced; another seed has other noise."""
    plain, faced = Random(P_set_W=1e3), Random(P_set_W=1e3, two_faced=True)
    values = [told.P_set - 1000.0 * k for k, told in enumerate(heard(plain))][10:20]

    assert len(set(values)) == 10
    assert all(abs(value) <= 1e3 for value in values)
    assert heard(plain) == heard(plain, "inv2")
    assert heard(plain) != heard(plain, seed=2)
    assert heard(faced) != heard(faced, "inv2")


def test_who_hears_a_lie() -> None:
    """Neighbours do, the plant only if the entry says so; a liar does not believe what it says in another's name."""
    own = NodeFault(name="inv3", lies=Offset(P_set_W=1.0))
    other = NodeFault(name="inv4", lies=Scale(Q=2.0, in_name_of="inv3", plant=True))
    netem = Netem(nodes=(other, own))

    assert [each.liar for each in lies_about(netem, "inv3", "inv1")] == ["inv3", "inv4"]
    assert [each.liar for each in lies_about(netem, "inv3", "plant")] == ["inv4"]
    assert [each.liar for each in lies_about(netem, "inv3", "inv4")] == ["inv3"]
    assert lies_about(netem, "inv4", "inv1") == ()
