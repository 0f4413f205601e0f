"""A value followed back over neighbours through time: each decision's largest term, and the state that it came from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from gridpeers.agents.laws.law import Term
from gridpeers.lab.explanation.law_step import LawStep, law_step
from gridpeers.scenarios.record.record_reader import RecordFileError, RunRecord
from gridpeers.scenarios.record.recorded_decision import RecordedDecision

Quantity = Literal["P_set", "V_set"]

HOPS = 8
"""Most decisions of a trail, unless told."""


@dataclass(frozen=True, kw_only=True)
class TrailStep:
    """One decision on the way back."""

    decision: RecordedDecision
    """The decision."""
    step: LawStep | None
    """The step of its law; None if the law was on hold."""
    largest: Term | None
    """The largest term, which is followed if it comes from a neighbour; None if there is none."""
    end: str
    """Why the trail ends here; empty if it goes on to the neighbour of the largest term."""


def trail(record: RunRecord, decision: RecordedDecision, quantity: Quantity, hops: int = HOPS) -> tuple[TrailStep, ...]:
    """Follow a set-point back: at each decision to the state behind the largest term of its step.

    It ends where the largest term is of the agent's own inverter, where the law was on hold, or after `hops` decisions.
    """
    steps: list[TrailStep] = []
    for hop in range(hops):
        step = law_step(record, decision)
        terms = () if step is None else getattr(step, quantity).terms
        largest = max(terms, key=lambda term: abs(term.value), default=None)
        before = None if largest is None else _behind(record, decision, largest)
        if step is None:
            end = decision.in_words
        elif largest is None or largest.value == 0.0:
            end = "no term moves it"
        elif not largest.neighbour:
            end = "the largest term is of the own inverter"
        elif before is None:
            end = f"the record has no decision of {largest.neighbour} behind that state"
        else:
            end = "" if hop + 1 < hops else f"{hops} decisions are shown"
        steps.append(TrailStep(decision=decision, step=step, largest=largest, end=end))
        if end or before is None:
            break
        decision = before
    return tuple(steps)


def _behind(record: RunRecord, decision: RecordedDecision, term: Term) -> RecordedDecision | None:
    """Return the decision that the state behind a term came from."""
    state = next((each.state for each in decision.neighbours if each.name == term.neighbour), None)
    if state is None:
        return None
    try:
        found = record.decision(state.sender, state.t)
    except RecordFileError:  # of an agent that keeps no journal
        return None
    return found if found.state.seq == state.seq and found.state.epoch == state.epoch else None
