"""What became of the states that an agent did not hear, by the links' verdicts, its journal and their sender."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from math import inf, isfinite

from gridpeers.netem.ledger import Outcome, copies_of
from gridpeers.scenarios.record.message_index import MessageOnWire
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.scenarios.record.recorded_decision import NeighbourInput, RecordedDecision
from gridpeers.wire.journal import MessageReference, ReceivedMessage, RejectedCount, kind_of, name_of
from gridpeers.wire.messages import OFF, PlantEvent, State
from gridpeers.wire.wording import counted

WORDS = {
    "cut": "cut off by a cut link",
    "partition": "cut off by a partition",
    "flap": "cut off by a flapping link",
    "loss": "lost on the link",
    "queue": "lost in a full queue of the link",
    "fault": "lost by a fault of the user's",
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
    record: RunRecord,
    decision: RecordedDecision,
    each: NeighbourInput,
    fates: Fates,
    rejected: Rejections,
) -> str:
    """Return in words what became of a neighbour's states after the last one that was heard.

    Examples of the result: "48 states since: 48 cut off by a partition"; "no state since". Nobody
    knows the sender of a rejected message without a number. It counts as one of the states whose fate nothing else
    tells, as long as there are any.
    """
    since = 0.0 if each.state is None else each.state.t
    last = -1 if each.number is None else each.number
    T = decision.config.T_c
    counts: Counter[str] = Counter()
    for message in record.messages(each.name, since=since, until=decision.t - 0.5 * T, kind="State"):
        if message.number > last or (each.state is not None and message.epoch != each.state.epoch):
            counts[_fate(message, decision.t, fates)] += 1
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


def _fate(message: MessageOnWire, now: float, fates: Fates) -> str:
    """Return why a state had not been heard by now (s of run time): a key of `WORDS`, or empty if nothing tells."""
    if isinstance(message.message, State) and (message.message.quiet or message.message.idle):
        return "quiet" if message.message.quiet else "idle"
    judged = [outcome for t, outcome in fates.get((message.sender, message.number), ()) if abs(t - message.t) < 1.0]
    if not judged:
        return ""
    outcome = judged[-1]
    if isinstance(outcome, str):
        return outcome
    sound = [delay for delay, bit in copies_of(outcome) if bit is None]
    if not sound:
        return "damaged"
    return "late" if isfinite(min(sound, default=inf)) else "kept"


def reason(record: RunRecord, decision: RecordedDecision, each: NeighbourInput) -> str:
    options = decision.config.control.degraded_communication
    if each.unused == "silent":
        return "no state of it was heard"
    if each.unused == "stale":
        most = options.max_age or decision.config.max_age
        return f"stale: older than max_age = {most:g} s"
    if each.unused == "island":
        here = decision.measurement.island
        if here == OFF:
            return "the own inverter is out of service"
        if each.state is not None and each.state.island == OFF:
            return "its inverter is out of service"
        if options.islands == "frequency" or each.state is None:
            return "in another island: its angle drifts"
        if _island_at(record, decision, each.state.t) == each.state.island:
            return f"its last state is from before the own island changed from {each.state.island} to {here}"
        return f"in another island: {each.state.island}, not {here}"
    return "" if each.weight > 0.0 else "its state is not new: weight 0"


def _island_at(record: RunRecord, decision: RecordedDecision, t: float) -> str:
    island = ""
    for message in record.messages(decision.agent, since=max(0.0, t - decision.config.T_c), until=t, kind="State"):
        if isinstance(message.message, State):
            island = message.message.island
    return island


def absence(decision: RecordedDecision, name: str, events: tuple[PlantEvent, ...]) -> str:
    """Return in words why an agent that the graph makes a neighbour was not met, from the last event about it."""
    if decision.config.clock == "simulated" and decision.restarted and not decision.neighbours:
        return "no state yet: at its first tick an agent has heard nobody"
    about = [event for event in events if event.subject == name and event.t <= decision.t + 1e-9]
    about = [event for event in about if event.kind == "roster"]
    return f"not met: {about[-1].text}" if about else "not met: it was not there"
