"""What a tick waits for, and the sentence when it waits too long."""

from __future__ import annotations

from gridpeers.wire.timing.tick_barrier import STOOD_STILL, Awaited, TickBarrier


def barrier() -> TickBarrier:
    """One that waits for two states since t = 5 s, at most 10 s."""
    made = TickBarrier("plant", 10.0)
    made.wait_for({"inv1": "State(4)", "inv2": "State(4)"}, now=5.0)
    return made


def test_it_opens_with_the_last_that_comes() -> None:
    """The number of messages counts down, to one at the least: somebody else may speak."""
    made = barrier()
    counted = []
    for name in ("inv2", "inv1"):
        assert not made.is_open
        counted.append(made.messages_needed)
        made.came(name)

    assert [*counted, made.messages_needed] == [2, 1, 1]
    assert made.is_open


def test_what_is_missing_is_named_in_the_order_of_the_wait() -> None:
    """Each with what it should send."""
    made = barrier()
    assert made.missing_messages() == (Awaited("State(4)", "inv1"), Awaited("State(4)", "inv2"))
    made.came("inv1")

    assert made.missing_messages() == (Awaited("State(4)", "inv2"),)


def test_the_deadline_counts_from_the_last_progress() -> None:
    """A rest has none."""
    made = barrier()
    until = [made.deadline]
    made.renew(7.0)
    until.append(made.deadline)
    made.rest()

    assert [*until, made.deadline] == [15.0, 17.0, None]


def test_the_complaint_names_what_and_whom_and_the_last_sign_of_life() -> None:
    """Also of who has never been heard."""
    made = barrier()
    made.last_heard["inv1"] = 3, 2.0

    assert made.complaint(made.missing_messages(), 15.0) == (
        "plant: no State(4) from inv1 within 10 s; last heard of inv1: tick 3, 13.0 s ago. "
        "no State(4) from inv2 within 10 s; nothing was ever heard from inv2"
    )


def test_who_looks_long_after_the_deadline_has_stood_still_itself() -> None:
    """A deadline has passed at its time or a little later; much later it counts anew, once for each standstill."""
    made = barrier()
    made.renew(0.0)
    due = made.deadline or 0.0

    assert [made.is_over(due - 0.1), made.is_over(due), made.is_over(due + STOOD_STILL)] == [False, True, True]
    assert not made.is_over(due + 600.0)
    assert made.deadline == 2.0 * due + 600.0
    assert made.is_over(made.deadline)
    made.rest()
    assert not made.is_over(1e9)
