from __future__ import annotations

import pytest

from gridpeers.wire.admission import PERSISTENT, Admission
from gridpeers.wire.codec import RejectedError
from gridpeers.wire.messages import State


def state(seq: int, epoch: int = 5, name: str = "inv2") -> State:
    """Sent at the pace of 20 ms."""
    return State(sender=name, epoch=epoch, seq=seq, t=min(0.02 * seq, 1e9), P_set=0.0, V_set=0.0, Q=0.0)


def bound(*epochs: int) -> Admission:
    """Processes of inv2 that came one after the other; the last one is there."""
    admission = Admission(rate=100.0)
    for epoch in epochs:
        admission.release("inv2")
        admission.bind("inv2", epoch)
    return admission


def refusal(admission: Admission, message: State) -> str:
    """Kind of reject that a message is; empty if it is none."""
    try:
        admission.check(message)
    except RejectedError as rejected:
        return rejected.kind
    return ""


@pytest.mark.parametrize("epochs", [(5,), (4, 5), (9, 5)])
def test_the_epoch_of_the_process_that_is_there_counts_and_no_other(epochs: tuple[int, ...]) -> None:
    """Whether its clock is ahead of its predecessor's or behind: what is greater does not matter."""
    admission = bound(*epochs)

    assert refusal(admission, state(0, 5)) == ""
    assert {refusal(admission, state(0, epoch)) for epoch in (0, 4, 6, 9, 2**53 - 1)} == {"ghost"}
    assert refusal(admission, state(0, 5, "inv3")) == "unexpected"


def test_who_is_gone_is_a_ghost_until_it_is_back() -> None:
    """A token that was lost and comes back finds its numbers where they were."""
    admission = bound(5)
    assert admission.take(state(7)) == 0
    assert admission.passes(state(7))
    admission.release("inv2")
    assert refusal(admission, state(8)) == "ghost"
    assert not admission.passes(state(8))
    admission.bind("inv2", 5)

    assert refusal(admission, state(8)) == ""
    assert not admission.passes(state(7))
    with pytest.raises(RejectedError, match="after 7"):
        admission.take(state(7))
    assert admission.take(state(10)) == 2


def test_in_a_new_epoch_numbers_begin_anew() -> None:
    """A restarted agent counts from 0; what its former life said last does not stand in its way."""
    admission = bound(5)
    admission.take(state(500))
    admission.passes(state(500))
    admission.release("inv2")
    admission.bind("inv2", 3)

    assert admission.take(state(0, 3)) == 0
    assert admission.passes(state(0, 3))
    assert not admission.passes(state(501, 5))


def test_a_number_that_nobody_can_have_reached_mutes_its_sender_for_a_second_only() -> None:
    """One lie far ahead would make all that follows stale, for ever; whoever goes on behind it is believed again."""
    admission = bound(5)
    for seq in range(100):
        admission.take(state(seq))
    missed = admission.take(state(2**53 - 1))
    admission.passes(state(2**53 - 1))
    refused = 0
    for seq in range(100, 300):
        try:
            admission.take(state(seq))
        except RejectedError:
            refused += 1

    assert missed == 0
    assert refused == PERSISTENT - 1
    assert admission.passes(state(300))


def test_old_messages_played_again_are_not_believed_while_their_sender_speaks() -> None:
    """However many come in a row of their own."""
    admission, refused = bound(5), 0
    for seq in range(1000, 1300):
        admission.take(state(seq))
        with pytest.raises(RejectedError):
            admission.take(state(seq - 900))
        refused += 1

    assert refused == 300
