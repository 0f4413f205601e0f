"""One decision explained: what the agent measured, whom it heard and whom not, and the terms of its law's step."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite

from gridpeers.agents.laws.call import objection_to
from gridpeers.agents.laws.law import Neighbour
from gridpeers.lab.explanation.law_step import LawStep, law_step
from gridpeers.netem.ledger import Outcome, copies_of
from gridpeers.scenarios.console import short
from gridpeers.scenarios.record.record_reader import RecordFileError, RunRecord
from gridpeers.scenarios.record.recorded_decision import NeighbourInput, RecordedDecision
from gridpeers.wire.journal import MessageReference, ReceivedMessage, RejectedCount, kind_of, name_of
from gridpeers.wire.messages import OFF, VALUES, PlantEvent, State
from gridpeers.wire.wording import counted

RECENT = 1.0


@dataclass(frozen=True, kw_only=True)
class NeighbourAccount:
    name: str
    input: NeighbourInput | None
    """Its last state as heard; None if the agent had not met it."""
    seen: Neighbour | None
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
    """Explain the decision of an agent that was in force at a run time (s); `events` are the record's, if known."""
    if agent not in record.agents:
        raise RecordFileError(f"{record.path}: there was no agent {agent!s:.64}; agents are {short(record.agents)}")
    decision = record.decision(agent, t)
    events = record.events() if events is None else events
    return Explanation(
        scenario=record.info.scenario,
        case=record.info.case,
        asked=t,
        decision=decision,
        neighbours=_accounts(record, decision, events),
        step=law_step(record, decision),
        events=tuple(
            event
            for event in events
            if decision.t - RECENT <= event.t <= decision.t + 1e-9
            or (event.subject == decision.agent and decision.t < event.t <= t)
        ),
        aftermath=aftermath(record, decision, t, events),
        damage=record.damage,
    )


def _accounts(
    record: RunRecord, decision: RecordedDecision, events: tuple[PlantEvent, ...]
) -> tuple[NeighbourAccount, ...]:
    usual = (1.5 if decision.config.clock == "simulated" else 2.5) * decision.config.T_c
    old = {each.name for each in decision.neighbours if each.age is None or each.age > usual}
    since = (0.0 if each.state is None else each.state.t for each in decision.neighbours if each.name in old)
    begin = min(since, default=decision.t)
    fates = verdicts(record, decision.agent, begin, decision.t) if old else {}
    rejected = rejections(record, decision.agent, begin, decision.t) if old else {}
    seen = {each.name: each for each in decision.neighbours_used}
    accounts = []
    for each in decision.neighbours:
        late = missed(record, decision, each, fates, rejected) if each.name in old else ""
        why = "; ".join(filter(None, (reason(record, decision, each), each.lie, late)))
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
    """Return in sentences what happened between a decision and a later run time (s) for which there is no other one."""
    T_c = decision.config.T_c
    if asked - decision.t <= 1.5 * T_c:
        return ()
    about = [
        event.text
        for event in events
        if event.kind == "roster" and event.subject == decision.agent and decision.t - T_c < event.t <= asked + 1e-9
    ]
    last = ": ".join([f"it is the last decision before {asked:g} s", *about[-1:]])
    values = _row(record, decision.agent, asked) if about or asked - decision.t >= SILENT * T_c else None
    if values is None:
        return (last,)
    _, P, Q, _, P_set, V_set = values
    if P == Q == 0.0:  # the plant reports exactly no power of an inverter that is off the network
        return last, f"at {asked:g} s its inverter is off the network"
    same = (P_set, V_set) == decision.after
    holds = "these set-points" if same else f"P_set = {P_set / 1e3:.2f} kW, V_set = {V_set:.2f} V"
    return last, f"at {asked:g} s its inverter is on the network, delivers {P / 1e3:.2f} kW, and keeps {holds}"


def _row(record: RunRecord, inverter: str, t: float) -> tuple[float, ...] | None:
    found: tuple[float, ...] | None = None
    for message in record.telemetry(since=max(0.0, t - 1.0), until=t):
        if inverter in message.inverters:
            start = 1 + VALUES * message.inverters.index(inverter)
            for row in message.rows:
                if row[0] <= t + 1e-9:
                    found = row[start : start + VALUES]
    return found


# -------------------------------------------------------------------- what became of the states that it did not hear


WORDS = {
    "cut": "cut off by a cut link",
    "partition": "cut off by a partition",
    "flap": "cut off by a flapping link",
    "loss": "lost on the link",
    "queue": "lost in a full queue of the link",
    "fault": "lost by a fault of your own",
    "checksum": "damaged on the link, and dropped",
    "damaged": "damaged on the link, and rejected: its CRC-32 differs",
    "late": "still on the way",
    "kept": "kept by a cut link",
    "quiet": "not sent to neighbours: its law saw no need",
    "idle": "idle: its agent is paused, or without a measurement",
}

Fates = Mapping[tuple[str, int], list[tuple[float, Outcome]]]
"""Verdicts by sender and number: when the message was sent (s of run time), and its outcome."""


Rejections = Mapping[str, list[tuple[int, str, int]]]
"""Rejected messages by sender: their number, -1 if it is not known; the kind of their rejection; how many."""


def verdicts(record: RunRecord, agent: str, since: float, until: float) -> Fates:
    found: dict[tuple[str, int], list[tuple[float, Outcome]]] = {}
    for trace in record.links():
        if trace.dst == agent:
            for seq, t, outcome in zip(trace.seq, trace.t, trace.outcome, strict=True):
                if since - 1e-9 <= t <= until + 1e-9:
                    found.setdefault((trace.src, seq), []).append((t, outcome))
    return found


def rejections(record: RunRecord, agent: str, since: float, until: float) -> Rejections:
    found: dict[str, list[tuple[int, str, int]]] = {}
    for entry in record.entries(agent, since=since, until=until):
        match entry:
            case MessageReference(key=key, seq=number, rejected=kind) if kind:
                rejected = number, kind, 1
            case ReceivedMessage(key=key, rejected=kind) if kind:
                rejected = -1, kind, 1
            case RejectedCount(key=key, kind=kind, count=count):
                rejected = -1, kind, count
            case _:
                continue
        if kind_of(key) == "state":
            found.setdefault(name_of(key), []).append(rejected)
    return found


def missed(
    record: RunRecord, decision: RecordedDecision, each: NeighbourInput, fates: Fates, rejected: Rejections
) -> str:
    """Return in words what became of a neighbour's states after the last one that was heard.

    Nobody knows the sender of a rejected message without a number. It counts as one of the states whose fate nothing
    else tells, as long as there are any.
    """
    since = 0.0 if each.state is None else each.state.t
    last = -1 if each.number is None else each.number
    counts: Counter[str] = Counter()
    declared = {quantity.name: quantity for quantity in decision.config.control.law.shared}
    for state in record.messages(State, each.name, since=since, until=decision.t - 0.5 * decision.config.T_c):
        if state.seq > last or (each.state is not None and state.epoch != each.state.epoch):
            fate = _fate(state, fates)
            beyond = not fate and objection_to(state.shared, declared)
            counts['rejected as "implausible"' if beyond else fate] += 1
    others: Counter[str] = Counter()
    for number, kind, count in sorted(rejected.get(each.name, ()), reverse=True):
        if number > last or (number < 0 and kind != "stale"):  # a stale one is older than the last one heard
            own = count if number > last else min(count, counts[""])
            counts[f'rejected as "{kind}"'] += own
            counts[""] -= min(own, counts[""])
            others[kind] += count - own
    total = sum(counts.values())
    known = ", ".join(f"{count} {WORDS.get(why, why)}" for why, count in counts.most_common() if why and count)
    text = f"{counted(total, 'state') if total else 'no state'} since" + (f": {known}" if known else "")
    strange = [
        f'{counted(count, "message")} on its key rejected as "{kind}"' for kind, count in others.items() if count
    ]
    return "; ".join([text, *strange])


def _fate(state: State, fates: Fates) -> str:
    """Return why a state has not been heard: a key of `WORDS`, or empty if nothing tells."""
    if state.quiet or state.idle:
        return "quiet" if state.quiet else "idle"
    judged = [outcome for t, outcome in fates.get((state.sender, state.seq), ()) if abs(t - state.t) < 1.0]
    outcome = judged[-1] if judged else ""
    if isinstance(outcome, str):
        return outcome
    sound = [delay for delay, bit in copies_of(outcome) if bit is None]
    return "damaged" if not sound else "late" if isfinite(min(sound)) else "kept"


def reason(record: RunRecord, decision: RecordedDecision, each: NeighbourInput) -> str:
    options, here = decision.config.control.degraded_communication, decision.measurement.island
    if each.unused == "silent":
        return "no state of it was heard"
    if each.unused == "stale":
        return f"stale: older than max_age = {options.max_age or decision.config.max_age:g} s"
    if each.unused != "island":
        return "" if each.weight > 0.0 else "its state is not new: weight 0"
    if here == OFF:
        return "the own inverter is out of service"
    if each.state is not None and each.state.island == OFF:
        return "its inverter is out of service"
    if options.islands == "frequency" or each.state is None:
        return "in another island: its angle drifts"
    if _island_at(record, decision, each.state.t) == each.state.island:
        return f"its last state is from before the own island changed from {each.state.island} to {here}"
    return f"in another island: {each.state.island}, not {here}"


def _island_at(record: RunRecord, decision: RecordedDecision, t: float) -> str:
    island = ""
    for state in record.messages(State, decision.agent, since=max(0.0, t - decision.config.T_c), until=t):
        island = state.island
    return island


def absence(decision: RecordedDecision, name: str, events: tuple[PlantEvent, ...]) -> str:
    """Return in words why an agent that the graph makes a neighbour was not met, from the last event about it."""
    if decision.config.clock == "simulated" and decision.restarted and not decision.neighbours:
        return "no state yet: at its first tick an agent has heard nobody"
    about = [e.text for e in events if (e.kind, e.subject) == ("roster", name) and e.t <= decision.t + 1e-9]
    return f"not met: {about[-1] if about else 'it was not there'}"
