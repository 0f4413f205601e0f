"""A set-point followed back to where it comes from."""

from __future__ import annotations

from typing import Any

import pytest

from gridpeers.agents.laws.law import Term
from gridpeers.lab.explanation import explanation as module
from gridpeers.lab.explanation.explanation import TrailStep, trail
from gridpeers.lab.explanation.law_step import LawStep, QuantityStep
from gridpeers.scenarios.record.record_reader import RecordFileError, RunRecord
from gridpeers.scenarios.record.recorded_decision import RecordedDecision
from tests.toy.toy_configs import agent_config
from tests.unit.lab.explanation.decisions import decision, neighbour, record_of, state

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
