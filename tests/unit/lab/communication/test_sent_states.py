"""The states of a sender by number and time: over its processes, and in windows that follow each other."""

from __future__ import annotations

from gridpeers.lab.communication.sent_states import SentState, SentStates, StateWindow


def test_epochs_have_no_order() -> None:
    """A fourth process whose epoch is below those before is kept, the first one is not, and what comes late of it."""
    sent = SentStates(simulated=False)
    for place, epoch in enumerate((7, 9, 8, 3)):
        assert sent.put(SentState(0, 10.0 * place, epoch, idle=False, quiet=False))

    assert [sent.window_of(epoch) is not None for epoch in (7, 9, 8, 3)] == [False, True, True, True]
    assert not sent.put(SentState(1, 0.02, 7, idle=False, quiet=False))
    assert sent.window_at(31.0) is sent.window_of(3)


def test_a_state_is_kept_in_force_as_long_as_nothing_else_is_sent() -> None:
    """By quiet states that follow it without a gap, however many they are; an idle or a lost one ends that."""
    window = StateWindow()
    for number in range(20_000):
        if number != 60:
            window.put(SentState(number, 0.02 * number, 1, idle=number == 40, quiet=number not in (5, 40, 80)))

    assert window.kept_until(80) == 19_999
    assert (window.kept_until(5), window.is_past(5)) == (5, True)
    fresh = StateWindow()
    for number in range(100):
        if number != 60:
            fresh.put(SentState(number, 0.02 * number, 1, idle=number == 40, quiet=number not in (5, 40, 80)))
    assert [fresh.kept_until(number) for number in (5, 41, 80)] == [39, 59, 99]
