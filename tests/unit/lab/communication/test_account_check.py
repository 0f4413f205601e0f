"""The account of messages: what was sent is delivered, dropped or under way, and each planted loss is caught."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import pytest

from gridpeers.scenarios.checks.checked_case import CheckedCase
from tests.unit.lab.communication.records import LOSSY, in_real_time
from tests.unit.scenarios.checks.cases import ran_with, verdict, with_content


def test_an_account_that_does_not_close_is_caught() -> None:
    """A link that loses a message without a word: sent is more than delivered, dropped and in flight."""
    case = ran_with(LOSSY).checked_case
    link = ("inv1", "inv2")
    counts = case.content.counts[link]
    wrong = dict(case.content.counts) | {link: msgspec.structs.replace(counts, delivered=counts.delivered - 1)}
    found = verdict(with_content(case, replace(case.content, counts=wrong)), "message_account")

    assert (found.count, found.violations[0].agent) == (1, "inv2")
    assert found.violations[0].value == (found.violations[0].limit or 0) - 1


def test_a_state_that_never_arrived_is_caught(sound: CheckedCase) -> None:
    """Without faults of links a decision has the states of the tick before: one that uses an older one has lost it."""
    content = sound.content
    epoch, entry = content.decisions["inv3"][-1]
    late = msgspec.structs.replace(entry, tick=200, states=[3, *entry.states[1:]])
    decisions = dict(content.decisions) | {"inv3": [*content.decisions["inv3"], (epoch, late)]}
    found = verdict(with_content(sound, replace(content, decisions=decisions)), "message_account")

    assert (found.status, found.violations[0].agent, found.violations[0].t) == ("failed", "inv3", pytest.approx(4.0))
    assert f"states of {entry.neighbours[0]} neither heard nor lost" in found.violations[0].text


def test_a_value_that_nobody_sent_is_caught(sound: CheckedCase) -> None:
    """A decision that names a state which its sender never sent."""
    content = sound.content
    states = dict(content.states)
    states["inv1"] = {key: state for key, state in states["inv1"].items() if state.number != 150}
    found = verdict(with_content(sound, replace(content, states=states)), "message_account")

    assert found.status == "failed"
    assert found.violations[0].t == pytest.approx(3.02)


def test_in_real_time_a_state_that_does_not_arrive_is_caught(sound: CheckedCase) -> None:
    """A number between others that the receiver never noted, and was not rejected either."""
    content = in_real_time(sound)
    (lost,) = (key for key, state in content.states["inv1"].items() if state.number == 150)
    arrived = {key: why for key, why in content.heard["inv1", "inv2"].items() if key != lost}
    wrong = replace(content, heard=dict(content.heard) | {("inv1", "inv2"): arrived})
    found = verdict(with_content(sound, wrong), "message_account")

    assert verdict(with_content(sound, content), "message_account").status == "passed"
    assert (found.count, found.violations[0].agent, found.violations[0].value) == (1, "inv2", 1.0)
    assert found.violations[0].t == pytest.approx(3.0)


def test_in_real_time_nothing_is_missed_while_the_receiver_is_away(sound: CheckedCase) -> None:
    """A process that left and came back owes no account of what was sent meanwhile, nor of its last second."""
    content = in_real_time(sound)
    states = {}
    for (epoch, number), state in content.states["inv2"].items():
        if not 2.0 < state.t < 3.0:
            back = epoch + (state.t >= 3.0)
            states[back, number] = state._replace(epoch=back)
    arrived = {key: "" for key, state in content.states["inv1"].items() if not 1.9 < state.t < 3.1}
    other = replace(content, states=dict(content.states) | {"inv2": states}, heard={("inv1", "inv2"): arrived})

    assert verdict(with_content(sound, other), "message_account").status == "passed"


def test_in_real_time_journals_that_come_late_change_no_account(sound: CheckedCase) -> None:
    """Nor do arrivals; a state that did not arrive is missing all the same."""
    content = in_real_time(sound)
    arrived = {key: "" for key, state in content.states["inv1"].items() if state.number % 50}
    wrong = replace(content, heard=dict(content.heard) | {("inv1", "inv2"): arrived})
    at_once, late = (with_content(sound, wrong, late=late) for late in (0.0, 2.0))

    assert verdict(at_once, "message_account") == verdict(late, "message_account")
    assert [one.value for one in verdict(late, "message_account").violations] == [5.0]
