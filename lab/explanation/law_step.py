"""The step of a law at a recorded decision, in its terms and what the limits took: they add up to the step taken."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass
from math import isfinite

from gridpeers.agents.carriers.law_registry import make_law
from gridpeers.agents.carriers.time_limit import limited
from gridpeers.agents.laws.law import LIMITS, Law, Own, SetPoints, Term, Terms, limits_in
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.scenarios.record.recorded_decision import RecordedDecision
from gridpeers.wire.plugins.registry import ANYTHING, named

TOLERANCE = 1e-12  # Largest difference (pu) between the step taken and the sum of its parts that rounding explains


@dataclass(frozen=True, kw_only=True)
class QuantityStep:
    before: float
    after: float
    terms: tuple[Term, ...]
    limits: float
    """Part that the limits of the law add, so that the set-point stays within them; 0 where they do not act."""
    low: float
    high: float

    @property
    def step(self) -> float:
        return self.after - self.before

    @property
    def rest(self) -> float:
        return self.step - (sum(term.value for term in self.terms) + self.limits)


@dataclass(frozen=True, kw_only=True)
class LawStep:
    P_set: QuantityStep
    V_set: QuantityStep
    problem: str = ""


def law_step(record: RunRecord, decision: RecordedDecision) -> LawStep | None:
    """Return the step of the law at a decision; None if the law was on hold.

    The law is made anew and gets the recorded inputs, since its last start if it has a memory. A law that is a program
    or an FMU is not started: its step is one term.
    """
    if decision.action != "law":
        return None
    choice = decision.config.control.law
    limits = {name: getattr(Law, name) for name in LIMITS} | limits_in(choice.parameters)
    if choice.command or choice.fmu:
        return _parts(decision, None, limits, f"the law is {choice.name}, which is not started for an explanation")
    try:
        law = make_law(decision.config.control)
    except ValueError as error:
        return _parts(decision, None, limits, f"the law cannot be loaded here: {error}")
    limits = {name: getattr(law, name) for name in LIMITS}
    problem = "computed again, the law makes another step: it has changed since, or remembers more than the record"
    with closing(law):
        has_no_memory = type(law).start is Law.start
        for since_start in (False, True) if has_no_memory else (True,):
            decisions = _since_start(record, decision) if since_start else (decision,)
            try:
                law.start(decisions[0].own)
                for each in decisions[:-1]:
                    law.step(each.own, each.neighbours_used, each.T)
                step = _parts(decision, law.step(decision.own, decision.neighbours_used, decision.T), limits)
            except ANYTHING as error:  # the law, and its answer, is anybody's code
                problem = f"computed again, the law raised {named(error)}"
                continue
            if max(abs(step.P_set.rest), abs(step.V_set.rest)) <= TOLERANCE:
                return step
    return _parts(decision, None, limits, problem)


def _since_start(record: RunRecord, decision: RecordedDecision) -> tuple[RecordedDecision, ...]:
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


def _parts(
    decision: RecordedDecision, result: SetPoints | Terms | None, limits: Mapping[str, float], problem: str = ""
) -> LawStep:
    """Return the parts of a step: the terms of a `result`, and the change by the limits (pu) of their sum.

    Without terms it is one term: the step of the result, or the recorded one.
    """
    own, config = decision.own, decision.config
    after = SetPoints(decision.after[0] / config.P_rated, decision.after[1] / config.V_nom)
    terms = _terms_of(result or after, own, config.control.law.time_limit)
    parts = {}
    for name, of in (("P_set", terms.P_set), ("V_set", terms.V_set)):
        if wrong := [term.value for term in of if not isfinite(term.value)]:
            raise ValueError(f"a term is {wrong[0]}; it must be a finite number (pu)")
        low, high, before = float(limits[f"{name}_min"]), float(limits[f"{name}_max"]), getattr(own, name)
        wanted = before + sum(term.value for term in of)
        parts[name] = QuantityStep(
            before=before,
            after=getattr(after, name),
            terms=tuple(of),
            limits=min(max(wanted, low), high) - wanted,
            low=low,
            high=high,
        )
    return LawStep(**parts, problem=problem)


def _terms_of(result: SetPoints | Terms, own: Own, time_limit: float) -> Terms:
    if isinstance(result, Terms):
        return result
    if result.terms is None:
        return Terms((Term("step", result.P_set - own.P_set),), (Term("step", result.V_set - own.V_set),))
    with limited("its terms", time_limit, f"time_limit_s = {time_limit:g} s"):  # a law's own function
        return result.terms()
