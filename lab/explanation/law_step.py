"""The step of a law at a recorded decision, in its terms and what the limits took: they add up to the step taken."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from math import isfinite

from gridpeers.agents.carriers.law_registry import make_law
from gridpeers.agents.laws.law import Law, SetPoints, Term, Terms
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.scenarios.record.recorded_decision import RecordedDecision, limits_of
from gridpeers.wire.plugins.registry import ANYTHING, named

TOLERANCE = 1e-12
"""Largest difference (pu) between the step taken and the sum of its parts that rounding explains."""


@dataclass(frozen=True, kw_only=True)
class QuantityStep:
    """The step of one set-point (pu of the own rating)."""

    before: float
    after: float
    terms: tuple[Term, ...]
    """Terms of the law, before its limits."""
    limits: float
    """Part that the limits of the law add, so that the set-point stays within them; 0 where they do not act."""
    low: float
    high: float

    @property
    def step(self) -> float:
        return self.after - self.before

    @property
    def rest(self) -> float:
        """Part of the step that neither terms nor limits explain."""
        return self.step - (sum(term.value for term in self.terms) + self.limits)


@dataclass(frozen=True, kw_only=True)
class LawStep:
    P_set: QuantityStep
    V_set: QuantityStep
    problem: str = ""
    """Why the parts are not those of the law computed again; empty if they are."""


def law_step(record: RunRecord, decision: RecordedDecision) -> LawStep | None:
    """Return the step of the law at a decision; None if the law was on hold.

    The law is made anew and gets the recorded inputs, since its last start if it has a memory. A law that is a program
    or an FMU is not started: its step is one term.
    """
    if decision.action != "law":
        return None
    choice = decision.config.control.law
    if choice.command or choice.fmu:
        return _whole_step(decision, f"the law is {choice.name}, which is not started for an explanation")
    try:
        law = make_law(decision.config.control)
    except ValueError as error:
        return _whole_step(decision, f"the law cannot be made here: {error}")
    problem = "computed again, the law makes another step: it is not the law of the run, or its memory is older"
    with closing(law):
        for since_start in (False, True) if _has_no_memory(law) else (True,):
            inputs = _since_start(record, decision) if since_start else (decision,)
            try:
                step = _parts(decision, *_computed_again(law, inputs))
            except ANYTHING as error:  # the law, and what it returns, is anybody's code
                problem = f"computed again, the law raised {named(error)}"
                continue
            if max(abs(step.P_set.rest), abs(step.V_set.rest)) <= TOLERANCE:
                return step
    return _whole_step(decision, problem)


def _has_no_memory(law: Law) -> bool:
    return type(law).start is Law.start


def _since_start(record: RunRecord, decision: RecordedDecision) -> tuple[RecordedDecision, ...]:
    """Return the decisions of a law since its last start, the last one included."""
    back = 1.0
    while True:
        since = max(0.0, decision.t - back)
        found = [
            each
            for each in record.decisions(decision.agent, since=since, until=decision.t)
            if each.state.epoch == decision.state.epoch
        ]
        starts = [i for i, each in enumerate(found) if each.restarted or (i > 0 and found[i - 1].action != "law")]
        if starts or since == 0.0:
            return tuple(each for each in found[starts[-1] if starts else 0 :] if each.action == "law")
        back *= 4.0


def _computed_again(law: Law, decisions: Sequence[RecordedDecision]) -> tuple[Terms | None, SetPoints]:
    law.start(decisions[0].own)
    for each in decisions[:-1]:
        law.step(each.own, each.neighbours_used, each.T)
    last = decisions[-1]
    inputs = last.own, last.neighbours_used, last.T
    terms = law.terms(*inputs)
    return terms, law.step(*inputs)


def _parts(decision: RecordedDecision, terms: Terms | None, result: SetPoints) -> LawStep:
    """Return the parts of a step: the terms, and what the limits make of their sum."""
    own = decision.own
    if terms is None:
        terms = Terms((Term("step", result.P_set - own.P_set),), (Term("step", result.V_set - own.V_set),))
    sums = [sum(_finite(term.value) for term in each) for each in terms]
    limits = limits_of(decision.config.control)
    parts = []
    for name, before, change, of in zip(
        ("P_set", "V_set"), (own.P_set, own.V_set), sums, (terms.P_set, terms.V_set), strict=True
    ):
        low, high = limits[f"{name}_min"], limits[f"{name}_max"]
        wanted = before + change
        parts.append(
            QuantityStep(
                before=before,
                after=_after(decision)[name],
                terms=tuple(of),
                limits=min(max(wanted, low), high) - wanted,
                low=low,
                high=high,
            )
        )
    return LawStep(P_set=parts[0], V_set=parts[1])


def _finite(value: float) -> float:
    if not isfinite(value):
        raise ValueError(f"a term is {value}; it must be a finite number (pu)")
    return value


def _after(decision: RecordedDecision) -> dict[str, float]:
    P_set, V_set = decision.after
    return {"P_set": P_set / decision.config.P_rated, "V_set": V_set / decision.config.V_nom}


def _whole_step(decision: RecordedDecision, problem: str) -> LawStep:
    """Return a step as one term, from the record alone."""
    own, after = decision.own, _after(decision)
    result = SetPoints(after["P_set"], after["V_set"])
    step = _parts(
        decision, Terms((Term("step", result.P_set - own.P_set),), (Term("step", result.V_set - own.V_set),)), result
    )
    return LawStep(P_set=step.P_set, V_set=step.V_set, problem=problem)
