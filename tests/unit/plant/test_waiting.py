"""What the plant waits for in each phase, and what it says of who does not come."""

from __future__ import annotations

import pytest

from plant.lockstep.roster import Roster
from plant.lockstep.waiting import Waiting
from plant.schedule import Schedule
from tests.toy.toy_configs import toy_configs
from wire.codec import RejectedError
from wire.messages import Ready, State
from wire.patience import Awaited

NAMES = ("inv1", "inv2")


def waiting() -> tuple[Waiting, Roster]:
    """A plant that waits for two agents and a recorder, at most 10 s, and its roster."""
    config, _ = toy_configs(2)
    roster = Roster(NAMES, NAMES, Schedule(config, NAMES))
    return Waiting(NAMES, ("fleet",), roster, 10.0), roster


def ready(sender: str, number: int) -> Ready:
    """Word that somebody is ready for a roster."""
    return Ready(sender=sender, incarnation=1, seq=number, t=0.0)


def state(sender: str, k: int) -> State:
    """Somebody's state of tick k."""
    return State(sender=sender, incarnation=1, seq=k, t=0.02 * k, P_set=5e4, V_set=277.0, Q=0.0)


def test_before_the_start_agents_and_recorders_are_awaited() -> None:
    """Recorders come last in the sentence, and are let off once they are there."""
    made, _ = waiting()

    assert made.missing(()) == (Awaited("token", "inv1"), Awaited("token", "inv2"), Awaited("token", "fleet"))
    assert Awaited("token", "fleet") not in made.missing({"fleet"})


def test_everybody_must_be_ready_for_this_roster() -> None:
    """Word on an earlier one is stale; who has died is not awaited."""
    made, roster = waiting()
    made.for_ready(roster.prepare(incarnation=1, t=0.0).seq, NAMES, now=0.0)
    made.ready(ready("inv2", 0))
    assert made.missing(()) == (Awaited("Ready(0)", "inv1"),)

    made.for_ready(roster.prepare(incarnation=1, t=0.0).seq, NAMES, now=0.0)
    with pytest.raises(RejectedError, match=r"Ready\(0\) of inv1 in phase preparing"):
        made.ready(ready("inv1", 0))
    assert made.wanted == 2
    made.ready(ready("inv1", 1))
    made.lost("inv2")

    assert not made.for_messages


def test_one_state_of_everybody_is_awaited_at_a_tick() -> None:
    """`wanted` counts down to one, and what is missing is named in the order of the roster."""
    made, _ = waiting()
    made.for_states(4, NAMES, now=0.0)
    assert made.missing(()) == (Awaited("State(4)", "inv1"), Awaited("State(4)", "inv2"))
    made.state(state("inv1", 4), tick=4)

    assert (made.wanted, made.for_messages) == (1, True)
    made.state(state("inv2", 4), tick=4)
    assert (made.wanted, made.for_messages) == (1, False)


@pytest.mark.parametrize(("k", "kind"), [(3, "stale"), (4, "stale"), (5, "unexpected")])
def test_a_state_that_is_not_awaited_is_refused(k: int, kind: str) -> None:
    """One of another tick, and a second one of this tick."""
    made, _ = waiting()
    made.for_states(4, NAMES, now=0.0)
    made.state(state("inv1", 4), tick=4)

    with pytest.raises(RejectedError) as refused:
        made.state(state("inv1", k), tick=4)
    assert refused.value.kind == kind


def test_only_between_preparing_and_ticking_the_run_begins() -> None:
    """The first roster's answers are part of the beginning; a later roster's are not."""
    made, roster = waiting()
    begun = [made.begun]
    made.for_ready(roster.prepare(incarnation=1, t=0.0).seq, NAMES, now=0.0)
    begun.append(made.begun)
    made.for_states(0, NAMES, now=0.0)
    begun.append(made.begun)
    made.for_ready(roster.prepare(incarnation=1, t=0.0).seq, NAMES, now=0.0)

    assert [*begun, made.begun] == [False, False, True, True]


def test_newcomers_are_awaited_with_token_and_nameplate() -> None:
    """Whom the tick is held for, and nobody else."""
    made, roster = waiting()
    roster.joining = ("inv2",)
    made.for_joiners(now=0.0)

    assert made.missing(()) == (Awaited("token", "inv2"),)
    roster.appeared("inv2", "b", t=0.0, gathering=False)
    assert made.missing(()) == (Awaited("nameplate", "inv2"),)


def test_each_wait_has_its_own_deadline() -> None:
    """It counts from the last progress; closing has its own, and in the end there is none."""
    made, _ = waiting()
    made.for_tokens(now=1.0)
    until = [made.until]
    made.for_states(0, NAMES, now=5.0)
    until.append(made.until)
    made.to_close(until=7.5)
    until.append(made.until)
    assert (made.missing(()), made.for_messages) == ((), False)
    made.be_over()

    assert [*until, made.until] == [11.0, 15.0, 7.5, None]


def test_the_complaint_tells_when_somebody_was_last_heard() -> None:
    """Who, what, for how long, and the last sign of life."""
    made, _ = waiting()
    made.for_states(4, ("inv1",), now=0.0)
    made.heard("inv1", 3, 2.0)

    assert made.complaint(made.missing(()), 12.0) == (
        "plant: no State(4) from inv1 within 10 s; last heard of inv1: tick 3, 10.0 s ago"
    )
