"""Heals in real time, where numbers of states have no gap while an agent stands still."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from gridpeers.lab.communication.accounts import Heals
from gridpeers.lab.communication.sent_states import NeighbourUse, SentState, SentStates, StateWindow, Uses
from gridpeers.netem.fault_schedule import Heal
from gridpeers.netem.ledger import LinkTrace

T_C = 0.02
LINK = ("inv2", "inv1")

Stops = list[tuple[float, float]]


def states(stops: Stops, last: float) -> list[SentState]:
    """States of an agent from 9.9 s on, a period apart but where it is stopped, with numbers in a row."""
    t = (9.9 + k * T_C for k in range(round((last - 9.9) / T_C) + 1))
    at_work = (time for time in t if not any(since < time < until for since, until in stops))
    return [SentState(number, time, 1, idle=False, quiet=False) for number, time in enumerate(at_work)]


def healed(receiver: list[SentState], sender: list[SentState], *, used_at_last: bool) -> Heal:
    """The heal of inv2 -> inv1 at 10 s, after which inv1 uses nothing new, or does so at its last state alone."""
    sent = {name: SentStates(simulated=False) for name in LINK}
    for name, said in zip(LINK, (sender, receiver), strict=True):
        for state in said:
            sent[name].put(state)
    info: Any = SimpleNamespace(simulated=False, T_c=T_C, agent_names=LINK, emulation=None)
    heals = Heals(info, 30.0, sent)
    heals.trace(LinkTrace(*LINK, seq=(1, 2), t=(9.0, 10.0), outcome=("cut", 0.0)))
    for state in receiver:
        new = used_at_last and state is receiver[-1]
        use = NeighbourUse(LINK, None, sender[-1].number if new else None, None, "" if new else "silent")
        heals.use("inv1", state, Uses((use,), None), new=True)
    (heal,) = heals.found()
    return heal


@pytest.mark.parametrize(
    ("stops", "waited"),
    [([], 10.2), ([(10.1, 20.0)], 0.2), ([(9.95, 20.0)], 0.2), ([(12.0, 12.2)], 10.2), ([(12.0, 13.0)], 7.2)],
    ids=["none", "after the heal", "around the heal", "shorter than a standstill", "in between"],
)
def test_a_stopped_receiver_waits_for_nothing(stops: Stops, waited: float) -> None:
    """It uses nothing new while it is frozen, which is no split; that of a busy host is shorter, and counts."""
    heal = healed(states(stops, 20.2), states([], 20.2), used_at_last=False)

    assert heal.took is None
    assert heal.waited == pytest.approx(waited, abs=2.5 * T_C)


@pytest.mark.parametrize(
    ("receiver", "sender", "took"),
    [([], [], 10.2), ([(10.1, 20.0)], [], 0.2), ([], [(10.1, 20.0)], 0.2)],
    ids=["none", "receiver", "sender"],
)
def test_the_time_to_a_new_value_counts_from_the_end_of_a_standstill(
    receiver: Stops, sender: Stops, took: float
) -> None:
    """Whichever of the two was frozen: nothing can be used before it goes on."""
    heal = healed(states(receiver, 20.2), states(sender, 20.2), used_at_last=True)

    assert heal.took == pytest.approx(took, abs=2.5 * T_C)


# -------------------------------------------------------------------- sent states


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
