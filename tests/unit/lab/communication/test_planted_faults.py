"""What each check of messages and agents finds where a fault is planted in a record."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import msgspec
import pytest

import gridpeers as gp
from gridpeers.scenarios.checks.checked_case import CheckedCase
from tests.unit.lab.communication.records import CUT, KILLED, LOSSY
from tests.unit.scenarios.checks.cases import altered, ran, ran_with, verdict, with_content


def test_an_account_that_does_not_close_is_caught() -> None:
    """A link that loses a message without a word: sent is more than delivered, dropped and in flight."""
    case = ran_with(LOSSY).checked_case
    link = ("inv1", "inv2")
    counts = case.content.counts[link]
    wrong = dict(case.content.counts) | {link: msgspec.structs.replace(counts, delivered=counts.delivered - 1)}
    found = verdict(with_content(case, altered(case.content, counts=wrong)), "message_account")

    assert (found.count, found.violations[0].agent) == (1, "inv2")
    assert found.violations[0].value == (found.violations[0].limit or 0) - 1


def test_a_state_that_never_arrived_is_caught(sound: CheckedCase) -> None:
    """Without faults of links a decision has the states of the tick before: one that uses an older one has lost it."""
    content = sound.content
    epoch, entry = content.decisions["inv3"][-1]
    late = msgspec.structs.replace(entry, tick=200, states=[3, *entry.states[1:]])
    decisions = dict(content.decisions) | {"inv3": [*content.decisions["inv3"], (epoch, late)]}
    found = verdict(with_content(sound, altered(content, decisions=decisions)), "message_account")

    assert (found.status, found.violations[0].agent, found.violations[0].t) == ("failed", "inv3", pytest.approx(4.0))
    assert f"states of {entry.neighbours[0]} neither heard nor lost" in found.violations[0].text


def test_a_value_that_nobody_sent_is_caught(sound: CheckedCase) -> None:
    """A decision that names a state which its sender never sent."""
    content = sound.content
    states = dict(content.states)
    states["inv1"] = {key: state for key, state in states["inv1"].items() if state.number != 150}
    found = verdict(with_content(sound, altered(content, states=states)), "message_account")

    assert found.status == "failed"
    assert found.violations[0].t == pytest.approx(3.02)


def test_a_stale_value_is_caught(sound: CheckedCase) -> None:
    """A value of 0.4 s where 0.25 s is the limit, with who used it and when."""
    content = sound.content
    epoch, entry = content.decisions["inv3"][-1]
    late = msgspec.structs.replace(entry, tick=200, states=[20, *entry.states[1:]])
    decisions = dict(content.decisions) | {"inv3": [*content.decisions["inv3"], (epoch, late)]}
    old = with_content(sound, altered(content, decisions=decisions))
    found = verdict(old, "stale_values")

    assert (found.count, found.violations[0].agent, found.violations[0].unit) == (1, "inv3", "s")
    assert (found.violations[0].value, found.violations[0].limit) == (pytest.approx(0.4), 0.25)
    assert found.violations[0].t == pytest.approx(4.0)
    assert verdict(old, "stale_values", max_age_s=0.5).status == "passed"


def test_a_cut_that_holds_the_last_state_makes_it_stale() -> None:
    """The paper's law holds what it heard last: after a cut of half a second that is too old."""
    changes = (("case.IV.link", repr([{"on": "inv2 -> inv1", "cut": True, "from_s": 2.0, "to_s": 2.5}])),)
    found = verdict(ran_with((*changes, ("time.end_s", "5.0"))).checked_case, "stale_values")

    assert (found.count, found.violations[0].agent) == (1, "inv1")
    assert found.violations[0].value == pytest.approx(0.5, abs=0.05)


def test_a_silence_longer_than_the_run_is_not_judged(sound: CheckedCase) -> None:
    """No agent could break it; one that never sends a state still does."""
    content = sound.content
    states = {name: states for name, states in content.states.items() if name != "inv9"}
    silent = verdict(with_content(sound, altered(content, states=states)), "last_words", silent_s=3600.0)

    assert verdict(sound, "last_words", silent_s=3600.0).reason.endswith("7 s to judge, and silent_s = 3600 s")
    assert (silent.status, silent.violations[0].text) == ("failed", "never sends a state")


def test_an_agent_that_falls_silent_is_caught(sound: CheckedCase) -> None:
    """No event says why: the time of its last state, and how long it was silent."""
    content = sound.content
    states = dict(content.states)
    states["inv7"] = {key: state for key, state in states["inv7"].items() if state.t <= 3.0}
    found = verdict(with_content(sound, altered(content, states=states)), "last_words")

    assert (found.count, found.violations[0].agent, found.violations[0].t) == (1, "inv7", pytest.approx(3.0))
    assert found.violations[0].value == pytest.approx(4.0, abs=0.05)


def test_an_agent_whose_process_was_replaced_is_not_called_silent(sound: CheckedCase) -> None:
    """A process ends at 3 s without an event, and the next one sends to the end from 3.5 s on: so long it was away."""
    content = sound.content
    states = dict(content.states)
    first, second = {}, {}
    for (_, number), state in states["inv7"].items():
        if state.t <= 3.0:
            first[0, number] = state._replace(epoch=0)
        elif state.t >= 3.5:
            second[1, number] = state._replace(epoch=1)
    states["inv7"] = first | second
    found = verdict(with_content(sound, altered(content, states=states)), "last_words")

    assert (found.count, found.violations[0].value) == (1, pytest.approx(0.5, abs=0.03))
    assert found.violations[0].sentence == (
        "its process ends, and nobody had asked for it; the next one sends after: inv7 0.5 s at t = 3.00 s"
    )


def test_an_agent_that_the_scenario_kills_or_lets_leave_is_explained() -> None:
    """The scenario kills inv2; another one lets it leave and return."""
    assert verdict(ran_with(KILLED).checked_case, "last_words").sentence == "last_words passed"
    assert (
        verdict(ran("plug-n-play", next(iter(gp.load("plug-n-play").cases))).checked_case, "last_words").status
        == "passed"
    )


def test_an_agent_that_leaves_without_an_event_is_caught() -> None:
    """The same run whose record lacks the event."""
    case = ran("plug-n-play", next(iter(gp.load("plug-n-play").cases))).checked_case
    found = verdict(replace(case, events=()), "last_words")

    assert found.status == "failed"
    assert found.violations[0].agent == "inv2"


def deaf(entry: Any) -> Any:
    """A decision that leaves inv2 out, as a state that was never heard."""
    if "inv2" not in entry.neighbours:
        return entry
    at = entry.neighbours.index("inv2")
    unused = [*(entry.unused or [""] * len(entry.neighbours))]
    unused[at] = "silent"
    states = [*entry.states]
    states[at] = None
    return msgspec.structs.replace(entry, unused=unused, states=states)


def test_agents_that_rejoin_after_a_cut_pass() -> None:
    """A cut of 0.16 s heals at once; before the limit's time is over the run ends, and it is judged all the same."""
    assert verdict(ran_with(CUT).checked_case, "heal").sentence == "heal passed"


def test_a_split_that_outlasts_its_heal_is_caught() -> None:
    """Agents that never use a state of inv2 after the cut are named, each."""
    case = ran_with(CUT).checked_case
    content = case.content
    decisions = {}
    for agent, entries in content.decisions.items():
        decisions[agent] = [(epoch, deaf(entry)) if entry.tick >= 100 else (epoch, entry) for epoch, entry in entries]
    found = verdict(with_content(case, altered(content, decisions=decisions)), "heal", within_s=1.0)

    assert found.count == 8
    assert all("no new value of inv2 is used after the cut ended at 2.16 s" in one.text for one in found.violations)
