"""What is told of a decision beside its terms."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from gridpeers.agents.laws.law import Term
from gridpeers.lab.explanation import explanation as module
from gridpeers.lab.explanation.explanation import TrailStep, explained, trail
from gridpeers.lab.explanation.law_step import LawStep, QuantityStep
from gridpeers.scenarios.record.message_index import on_wire
from gridpeers.scenarios.record.record_reader import RecordFileError, RunRecord
from gridpeers.scenarios.record.recorded_decision import RecordedDecision
from gridpeers.wire.codec import encode
from gridpeers.wire.messages import PlantEvent
from tests.toy.toy_configs import agent_config
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


TERMS: dict[tuple[str, int], tuple[Term, ...]] = {
    ("inv1", 10): (Term("own", 0.1), Term("leads", -0.3, "inv2"), Term("follows", 0.2, "inv3")),
    ("inv2", 9): (Term("leads", 0.5, "inv1"), Term("own", -0.4)),
    ("inv1", 8): (Term("own", -0.2), Term("leads", 0.1, "inv2")),
}


def made(name: str, tick: int, other: str, **changes: Any) -> RecordedDecision:
    """A decision of one of two agents, with the state of the tick before of the other."""
    config = agent_config(name)
    return decision(neighbour(other, tick - 1), tick=tick, config=config, state=state(name, tick), **changes)


DECISIONS = [made("inv1", 10, "inv2"), made("inv2", 9, "inv1"), made("inv1", 8, "inv2")]


def steps_of(hops: int = 8, decisions: list[RecordedDecision] = DECISIONS, **answers: Any) -> tuple[TrailStep, ...]:
    """The trail from the first of some decisions."""

    def at(agent: str, t: float) -> RecordedDecision:
        found = [each for each in decisions if each.agent == agent and abs(each.t - t) < 1e-9]
        if not found:
            raise RecordFileError("none")
        return found[0]

    return trail(record_of(decision=at, **answers), decisions[0], "P_set", hops)


@pytest.fixture(autouse=True)
def known_terms(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have each decision those terms that are named above."""

    def law_step(record: RunRecord, decided: RecordedDecision) -> LawStep | None:
        if decided.action != "law":
            return None
        terms = TERMS.get((decided.agent, decided.tick), ())
        step = QuantityStep(before=0.5, after=0.6, terms=terms, limits=0.0, low=0.0, high=1.0)
        return LawStep(P_set=step, V_set=step)

    monkeypatch.setattr(module, "law_step", law_step)


def test_the_largest_term_is_followed_whatever_its_sign() -> None:
    """To the decision behind its state, until the largest term is of the agent's own inverter."""
    found = steps_of()

    assert [(each.decision.agent, each.decision.tick) for each in found] == [("inv1", 10), ("inv2", 9), ("inv1", 8)]
    assert [each.largest and each.largest.name for each in found] == ["leads", "leads", "own"]
    assert [each.end for each in found] == ["", "", "the largest term is of the own inverter"]


def test_a_trail_is_as_long_as_asked_for() -> None:
    """And its last decision says that it was cut."""
    found = steps_of(hops=2)

    assert [each.end for each in found] == ["", "2 decisions are shown"]


def test_a_trail_ends_where_nothing_is_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    """On hold, without a term, and where the record has no decision behind a state or one of another life."""
    hold = made("inv2", 9, "inv1", action="hold")
    assert steps_of(decisions=[DECISIONS[0], hold])[-1].end == hold.in_words
    still = made("inv2", 9, "inv1")
    monkeypatch.setitem(TERMS, ("inv3", 9), (Term("leads", 0.0, "inv2"),))
    assert steps_of(decisions=[made("inv3", 9, "inv2")])[-1].end == "no term moves it"
    assert steps_of(decisions=[DECISIONS[0]])[-1].end == "the record has no decision of inv2 behind that state"
    other = RecordedDecision(**vars(still) | {"state": state("inv2", 8)})
    assert steps_of(decisions=[DECISIONS[0], other])[-1].end == "the record has no decision of inv2 behind that state"
