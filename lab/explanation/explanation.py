"""One decision explained: what the agent measured, whom it heard and whom not, and the terms of its law's step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from gridpeers.agents.laws.law import Neighbour, Term
from gridpeers.lab.explanation.law_step import LawStep, law_step
from gridpeers.lab.explanation.unheard import absence, missed, reason, rejections, verdicts
from gridpeers.scenarios.record.record_reader import RecordFileError, RunRecord
from gridpeers.scenarios.record.recorded_decision import NeighbourInput, RecordedDecision
from gridpeers.scenarios.short_texts import short
from gridpeers.wire.messages import VALUES, PlantEvent

RECENT = 1.0


@dataclass(frozen=True, kw_only=True)
class NeighbourAccount:
    name: str
    input: NeighbourInput | None
    """Its last state as heard; None if the agent had not met it."""
    seen: Neighbour | None
    """It as the law saw it (pu); None if it was left out."""
    why: str
    """Why it was left out, or why its state is old; empty if neither."""

    @property
    def used(self) -> bool:
        return self.seen is not None and self.seen.weight > 0.0


@dataclass(frozen=True, kw_only=True)
class Explanation:
    """Why an agent decided as it did. `str` gives the text of `gridpeers why`."""

    scenario: str
    case: str
    asked: float
    """Run time (s) that was asked for; the decision was in force then."""
    decision: RecordedDecision
    neighbours: tuple[NeighbourAccount, ...]
    """The in-neighbours by the graph: those that the agent had met, then the others."""
    step: LawStep | None
    events: tuple[PlantEvent, ...]
    aftermath: tuple[str, ...]
    """Sentences on the time between the decision and the one that was asked for; none if it was made then."""
    damage: tuple[str, ...]

    @property
    def agent(self) -> str:
        return self.decision.agent

    @property
    def t(self) -> float:
        return self.decision.t

    def __str__(self) -> str:
        from gridpeers.lab.explanation.explanation_text import text_of

        return text_of(self)


def explain(record: RunRecord, agent: str, t: float, events: tuple[PlantEvent, ...] | None = None) -> Explanation:
    """Explain the decision of an agent that was in force at a run time (s).

    `events` are those of the record, if they are known already: to read them takes its whole file.
    """
    if agent not in record.agents:
        raise RecordFileError(f"{record.path}: there was no agent {agent!s:.64}; agents are {short(record.agents)}")
    return explained(record, record.decision(agent, t), t, events)


def explained(
    record: RunRecord, decision: RecordedDecision, asked: float, events: tuple[PlantEvent, ...] | None = None
) -> Explanation:
    events = record.events() if events is None else events
    step = law_step(record, decision)
    return Explanation(
        scenario=record.info.scenario,
        case=record.info.case,
        asked=asked,
        decision=decision,
        neighbours=_accounts(record, decision, events),
        step=step,
        events=tuple(
            event
            for event in events
            if decision.t - RECENT <= event.t <= decision.t + 1e-9
            or (event.subject == decision.agent and decision.t < event.t <= asked)
        ),
        aftermath=aftermath(record, decision, asked, events),
        damage=record.damage,
    )


def _accounts(
    record: RunRecord, decision: RecordedDecision, events: tuple[PlantEvent, ...]
) -> tuple[NeighbourAccount, ...]:
    usual = (1.5 if decision.config.clock == "simulated" else 2.5) * decision.config.T_c
    old = [each for each in decision.neighbours if each.age is None or each.age > usual]
    begin = min((0.0 if each.state is None else each.state.t for each in old), default=decision.t)
    fates = verdicts(record, decision.agent, begin, decision.t) if old else {}
    rejected = rejections(record, decision.agent, begin, decision.t) if old else {}
    seen = {each.name: each for each in decision.neighbours_used}
    accounts = []
    for each in decision.neighbours:
        why = "; ".join(filter(None, (reason(record, decision, each), each.lie)))
        if any(each is other for other in old):
            why = "; ".join(filter(None, (why, missed(record, decision, each, fates, rejected))))
        accounts.append(NeighbourAccount(name=each.name, input=each, seen=seen.get(each.name), why=why))
    for name in decision.not_met:
        why = "idle agents hear nobody" if decision.action == "idle" else absence(decision, name, events)
        accounts.append(NeighbourAccount(name=name, input=None, seen=None, why=why))
    return tuple(accounts)


# -------------------------------------------------------------------- after the last decision


SILENT = 10
"""Control periods without a decision after which the inverter is looked at, though nothing says that its agent left."""


def aftermath(
    record: RunRecord, decision: RecordedDecision, asked: float, events: Sequence[PlantEvent]
) -> tuple[str, ...]:
    """Return in sentences what happened between a decision and a later run time (s) for which there is no other one.

    Empty if the decision is of that time.
    """
    T_c = decision.config.T_c
    if asked - decision.t <= 1.5 * T_c:
        return ()
    about = [
        event
        for event in events
        if event.kind == "roster" and event.subject == decision.agent and decision.t - T_c < event.t <= asked + 1e-9
    ]
    last = f"it is the last decision before {asked:g} s"
    if not about and asked - decision.t < SILENT * T_c:
        return (last,)
    last += f": {about[-1].text}" if about else ""
    values = _row(record, decision.agent, asked)
    if values is None:
        return (last,)
    _, P, Q, _, P_set, V_set = values
    if P == Q == 0.0:  # the plant reports exactly no power of an inverter that is off the network
        return last, f"at {asked:g} s its inverter is off the network"
    same = (P_set, V_set) == decision.after
    holds = "these set-points" if same else f"P_set = {P_set / 1e3:.2f} kW, V_set = {V_set:.2f} V"
    return last, f"at {asked:g} s its inverter is on the network, delivers {P / 1e3:.2f} kW, and keeps {holds}"


def _row(record: RunRecord, inverter: str, t: float) -> tuple[float, ...] | None:
    """Return f, P, Q, V, P_set and V_set of an inverter in the last row up to a run time (s)."""
    found: tuple[float, ...] | None = None
    for message in record.telemetry(since=max(0.0, t - 1.0), until=t):
        if inverter in message.inverters:
            start = 1 + VALUES * message.inverters.index(inverter)
            for row in message.rows:
                if row[0] <= t + 1e-9:
                    found = row[start : start + VALUES]
    return found


# -------------------------------------------------------------------- a value followed back


Quantity = Literal["P_set", "V_set"]


@dataclass(frozen=True, kw_only=True)
class TrailStep:
    decision: RecordedDecision
    step: LawStep | None
    largest: Term | None
    end: str
    """Why the trail ends here; empty if it goes on to the neighbour of the largest term."""


def trail(record: RunRecord, decision: RecordedDecision, quantity: Quantity, hops: int) -> tuple[TrailStep, ...]:
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
    state = next((each.state for each in decision.neighbours if each.name == term.neighbour), None)
    if state is None:
        return None
    try:
        found = record.decision(state.sender, state.t)
    except RecordFileError:  # of an agent that keeps no journal
        return None
    return found if found.state.seq == state.seq and found.state.epoch == state.epoch else None
