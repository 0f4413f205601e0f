"""What a tick of an agent waits for: its measurement, and its neighbours' states of the tick before."""

from __future__ import annotations

from itertools import permutations

import pytest

from agents.lockstep.turn import Turn
from wire.codec import RejectedError
from wire.messages import PLANT, Measurement, State
from wire.patience import Awaited

ROSTER = ("inv1", "inv2", "inv3")
BOTH = {"inv2": "b", "inv3": "c"}


def measured(k: int, roster: tuple[str, ...] = ROSTER) -> Measurement:
    """The grant of tick k."""
    return Measurement(
        sender="plant", incarnation=1, seq=k, t=0.02 * k, to="inv1", P=5e4, Q=0.0, V=277.0, f=60.0, P_set=5e4,
        V_set=277.0, grid_connected=False, island="inv1", roster=roster,
    )  # fmt: skip


def state(sender: str, k: int) -> State:
    """What a neighbour has computed at tick k."""
    return State(sender=sender, incarnation=1, seq=k, t=0.02 * k, P_set=5e4, V_set=277.0, Q=0.0)


def turn(tick: int = 5) -> Turn:
    """A turn that waits for both neighbours' states of the tick before."""
    made = Turn()
    made.grant(measured(tick - 1))
    made.next(BOTH)
    return made


def test_the_first_tick_needs_the_measurement_alone() -> None:
    """It is whichever tick the plant grants first."""
    made = Turn()
    assert made.missing() == (Awaited("Measurement(0)", PLANT),)

    made.grant(measured(41))

    assert made.tick == 41
    assert made.granted() == measured(41)


@pytest.mark.parametrize("order", list(permutations((measured(5), state("inv2", 4), state("inv3", 4)))))
def test_a_tick_is_granted_by_whatever_comes_last(order: tuple[Measurement | State, ...]) -> None:
    """Measurement and states in any order: nothing before all are there, and `wanted` counts them down."""
    made, wanted = turn(5), []
    for message in order:
        assert made.granted() is None
        wanted.append(made.wanted)
        if isinstance(message, Measurement):
            made.grant(message)
        else:
            assert made.take(message, b"")

    assert wanted == [3, 2, 1]
    assert made.granted() == measured(5)


def test_an_early_state_is_kept_for_the_next_tick() -> None:
    """It is handed out, with its bytes, when this tick is done, and not awaited then."""
    made = turn(5)
    assert not made.take(state("inv2", 5), b"early")
    assert set(made.waiting) == {"inv2", "inv3"}

    assert made.next(BOTH) == [(state("inv2", 5), b"early")]
    assert made.waiting == {"inv3": "c"}
    assert made.next(BOTH) == []


def test_of_what_came_before_the_first_measurement_only_its_own_tick_counts() -> None:
    """A newcomer hears states before it knows which tick is its first."""
    made = Turn()
    made.take(state("inv2", 40), b"")
    made.take(state("inv3", 41), b"kept")
    made.grant(measured(41))

    assert made.next(BOTH) == [(state("inv3", 41), b"kept")]


def test_who_is_off_the_roster_is_not_awaited() -> None:
    """The measurement's roster ends the wait, though the token may still be there."""
    made = turn(5)
    made.take(state("inv2", 4), b"")
    made.grant(measured(5, roster=("inv1", "inv2")))

    assert made.granted() is not None
    assert made.waiting == {}


def test_the_awaited_process_alone_ends_a_wait_by_dying() -> None:
    """A namesake's end does not."""
    made = turn(5)

    assert not made.lost("inv2", "impostor")
    assert made.lost("inv2", "b")
    assert not made.lost("inv2", "b")
    assert made.waiting == {"inv3": "c"}


def test_what_is_missing_is_named_in_the_order_of_the_neighbours() -> None:
    """First the measurement, then the states."""
    made = turn(5)
    assert made.missing() == (Awaited("Measurement(5)", PLANT),)

    made.grant(measured(5))

    assert made.missing() == (Awaited("State(4)", "inv2"), Awaited("State(4)", "inv3"))


@pytest.mark.parametrize(("k", "kind"), [(4, "stale"), (6, "unexpected")])
def test_a_measurement_of_another_tick_is_refused(k: int, kind: str) -> None:
    """Ticks are granted one by one."""
    with pytest.raises(RejectedError) as refused:
        turn(5).grant(measured(k))
    assert refused.value.kind == kind


def test_a_second_measurement_of_a_tick_is_refused() -> None:
    """A tick is granted once."""
    made = turn(5)
    made.grant(measured(5))

    with pytest.raises(RejectedError) as refused:
        made.grant(measured(5))
    assert refused.value.kind == "stale"


@pytest.mark.parametrize(("k", "kind"), [(3, "stale"), (6, "unexpected")])
def test_a_state_of_neither_tick_is_refused(k: int, kind: str) -> None:
    """It must be of the tick before, or of this one."""
    with pytest.raises(RejectedError) as refused:
        turn(5).take(state("inv2", k), b"")
    assert refused.value.kind == kind
