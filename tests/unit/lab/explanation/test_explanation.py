"""What is told of a decision beside its terms."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from gridpeers.lab.explanation.explanation import explained
from gridpeers.scenarios.record.message_index import on_wire
from gridpeers.scenarios.record.recorded_decision import RecordedDecision
from gridpeers.wire.codec import encode
from gridpeers.wire.messages import PlantEvent
from tests.unit.lab.explanation.decisions import decision, neighbour, record_of, state


def told(decided: RecordedDecision, *events: PlantEvent, asked: float | None = None) -> Any:
    """The explanation of a decision, in a record in which inv2 has sent a state at each tick."""
    states = [on_wire("state/inv2", encode(state("inv2", number)), None) for number in range(10)]

    def messages(name: str, *, since: float, until: float, kind: str) -> Any:
        return (each for each in states if since - 1e-9 <= each.t <= until + 1e-9)

    record = record_of(
        info=SimpleNamespace(scenario="toy", case="case"),
        damage=(),
        links=lambda: iter(()),
        messages=messages,
        entries=lambda *words, **more: iter(()),
        telemetry=lambda **more: iter(()),
    )
    return explained(record, decided, decided.t if asked is None else asked, events)


def event(t: float, subject: str = "inv2") -> PlantEvent:
    """An event at a time."""
    return PlantEvent(t=t, kind="roster", subject=subject, text=f"{subject} at {t:g} s")


def test_events_of_the_last_second_are_told() -> None:
    """And later ones that are about the agent itself, up to the time that was asked for."""
    decided = decision(tick=100)  # at 2 s
    events = (event(0.9), event(1.1), event(2.0), event(2.1), event(2.1, "inv1"), event(2.9, "inv1"))

    assert [each.t for each in told(decided, *events).events] == [1.1, 2.0]
    later = told(decided, *events, asked=2.5).events
    assert [(each.t, each.subject) for each in later] == [(1.1, "inv2"), (2.0, "inv2"), (2.1, "inv1")]


@pytest.mark.parametrize(("number", "why"), [(9, ""), (8, "1 state since"), (6, "3 states since")])
def test_of_an_old_state_it_is_told_what_became_of_the_later_ones(number: int, why: str) -> None:
    """One of the tick before is as new as can be, and has nothing to be told."""
    (account,) = told(decision(neighbour("inv2", number))).neighbours

    assert account.why == why


def test_a_neighbour_without_weight_does_not_count() -> None:
    """Nor does one that was left out, though its state is told."""
    full, none, silent = told(
        decision(neighbour("inv2", 9), neighbour("inv3", 9, weight=0.0), neighbour("inv4", None))
    ).neighbours

    assert (full.used, none.used, silent.used) == (True, False, False)
    assert none.seen is not None
    assert silent.seen is None
