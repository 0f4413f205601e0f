"""The check that every agent speaks until the run ends, or an event says why it does not."""

from __future__ import annotations

from dataclasses import replace

import pytest

import gridpeers as gp
from gridpeers.scenarios.checks.checked_case import CheckedCase
from tests.unit.lab.communication.records import KILLED
from tests.unit.scenarios.checks.cases import ran, ran_with, verdict, with_content


def test_a_silence_longer_than_the_run_is_not_judged(sound: CheckedCase) -> None:
    """No agent could break it; one that never sends a state still does."""
    content = sound.content
    states = {name: states for name, states in content.states.items() if name != "inv9"}
    silent = verdict(with_content(sound, replace(content, states=states)), "last_words", silent_s=3600.0)

    assert verdict(sound, "last_words", silent_s=3600.0).reason.endswith("7 s to judge, and silent_s = 3600 s")
    assert (silent.status, silent.violations[0].text) == ("failed", "never sends a state")


def test_an_agent_that_falls_silent_is_caught(sound: CheckedCase) -> None:
    """No event says why: the time of its last state, and how long it was silent."""
    content = sound.content
    states = dict(content.states)
    states["inv7"] = {key: state for key, state in states["inv7"].items() if state.t <= 3.0}
    found = verdict(with_content(sound, replace(content, states=states)), "last_words")

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
    found = verdict(with_content(sound, replace(content, states=states)), "last_words")

    assert (found.count, found.violations[0].value) == (1, pytest.approx(0.5, abs=0.03))
    assert found.violations[0].sentence == (
        "its process ends, and no event says why; its next one sends after: inv7 0.5 s at t = 3.00 s"
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
