"""One decision explained: what the agent measured, whom it heard and whom not, and the terms of its law's step."""

from __future__ import annotations

from dataclasses import dataclass

from gridpeers.agents.laws.law import Neighbour
from gridpeers.lab.explanation.last_decision import aftermath
from gridpeers.lab.explanation.law_step import LawStep, law_step
from gridpeers.lab.explanation.unheard import absence, missed, reason, rejections, verdicts
from gridpeers.scenarios.record.record_reader import RecordFileError, RunRecord
from gridpeers.scenarios.record.recorded_decision import NeighbourInput, RecordedDecision
from gridpeers.scenarios.short_texts import short
from gridpeers.wire.messages import PlantEvent

RECENT = 1.0
"""Time (s) before the decision whose events are told."""


@dataclass(frozen=True, kw_only=True)
class NeighbourAccount:
    """An in-neighbour at a decision, and what became of it."""

    name: str
    """Its name."""
    input: NeighbourInput | None
    """Its last state as heard; None if the agent had not met it."""
    seen: Neighbour | None
    """It as the law saw it (pu); None if it was left out."""
    why: str
    """Why it was left out, or why its state is old; empty if neither."""

    @property
    def used(self) -> bool:
        """Whether its state counts in the sums of the law."""
        return self.seen is not None and self.seen.weight > 0.0


@dataclass(frozen=True, kw_only=True)
class Explanation:
    """Why an agent decided as it did. `str` gives the text of `gridpeers why`."""

    scenario: str
    """Name of the scenario."""
    case: str
    """Name of the case."""
    asked: float
    """Run time (s) that was asked for; the decision was in force then."""
    decision: RecordedDecision
    """The decision: its inputs and the state that came out, in SI units."""
    neighbours: tuple[NeighbourAccount, ...]
    """The in-neighbours by the graph: those that the agent had met, then the others."""
    step: LawStep | None
    """The step of the law in its terms (pu); None if the law was on hold."""
    events: tuple[PlantEvent, ...]
    """Events of the last second before the decision, and those about the agent since."""
    aftermath: tuple[str, ...]
    """Sentences on the time between the decision and the one that was asked for; none if it was made then."""
    damage: tuple[str, ...]
    """What could not be read of the record."""

    @property
    def agent(self) -> str:
        """Name of the agent."""
        return self.decision.agent

    @property
    def t(self) -> float:
        """Run time of the decision (s)."""
        return self.decision.t

    def __str__(self) -> str:
        """Return it in words and numbers."""
        from gridpeers.lab.explanation.explanation_text import text_of

        return text_of(self)


def explain(record: RunRecord, agent: str, t: float, events: tuple[PlantEvent, ...] | None = None) -> Explanation:
    """Explain the decision of an agent that was in force at a run time (s).

    `events` are those of the record, if they are known already: to read them takes its whole file.

    Raises
    ------
    RecordFileError
        If there was no such agent, the time is outside of the record, the agent had not decided by then, or the record
        has no decisions.
    """
    if agent not in record.agents:
        raise RecordFileError(f"{record.path}: there was no agent {agent!s:.64}; agents are {short(record.agents)}")
    return explained(record, record.decision(agent, t), t, events)


def explained(
    record: RunRecord, decision: RecordedDecision, asked: float, events: tuple[PlantEvent, ...] | None = None
) -> Explanation:
    """Explain a decision of a record."""
    events = record.events() if events is None else events
    step = law_step(record, decision)
    return Explanation(
        scenario=record.info.scenario,
        case=record.info.case,
        asked=asked,
        decision=decision,
        neighbours=_accounts(record, decision, events),
        step=step,
        events=tuple(event for event in events if _matters(event, decision, asked)),
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


def _matters(event: PlantEvent, decision: RecordedDecision, asked: float) -> bool:
    """Whether an event is worth telling beside a decision."""
    if decision.t - RECENT <= event.t <= decision.t + 1e-9:
        return True
    return event.subject == decision.agent and decision.t < event.t <= asked
