"""The messages of a run as flows: from whom to whom, when sent and when arrived, or why not."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf, isfinite
from typing import NamedTuple

from gridpeers.netem.ledger import Outcome, copies_of
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.wire.codec import sound
from gridpeers.wire.journal import EACH_TICK, SentMessage, kind_of
from gridpeers.wire.messages import PLANT, Measurement, State


class Flow(NamedTuple):
    """One message on its way to one receiver, with run times (s); each copy of an emulated link is one of its own."""

    sent: float
    src: str
    dst: str
    number: int
    arrived: float | None
    """When it arrived (s of run time); None if it never did."""
    fate: str = ""
    """Why it was dropped, or not used: a reason of netem, "damaged", "kept" by a cut, or the kind of its rejection;
    empty if it was handed on."""

    @property
    def is_lost(self) -> bool:
        return self.arrived is None


def flows(record: RunRecord, since: float = 0.0, until: float = inf) -> list[Flow]:
    """Return the measurements and states of a run that were sent between two run times (s), in the order of sending.

    Of emulated links these are their verdicts, from the first one on. In simulated time a state arrives at a neighbour
    with the decision that can first use it, one period later or after its delay, and at the plant at once, like
    measurements. In wall-clock time they arrive when the receiver noted them.
    """
    found: dict[tuple[str, str, int, float], list[Flow]] = {}
    first: dict[tuple[str, str], float] = {}
    least = record.info.T_c if record.info.clock == "simulated" else 0.0
    for trace in record.links():
        link = trace.src, trace.dst
        for number, t, outcome in zip(trace.seq, trace.t, trace.outcome, strict=True):
            first[link] = min(first.get(link, inf), t)
            if since - 1e-9 <= t <= until + 1e-9:  # a message that was judged anew has a second row, which counts
                found[(*link, number, t)] = list(
                    _judged(trace.src, trace.dst, number, t, outcome, 0.0 if PLANT in link else least)
                )
    result = [flow for copies in found.values() for flow in copies]
    others = _noted if record.info.clock == "wall" else _implied
    result += [flow for flow in others(record, since, until) if flow.sent < first.get((flow.src, flow.dst), inf) - 1e-9]
    return sorted(result, key=lambda flow: (flow.sent, flow.src, flow.dst, flow.number, flow.arrived or inf))


def _judged(src: str, dst: str, number: int, t: float, outcome: Outcome, least: float) -> Iterator[Flow]:
    if isinstance(outcome, str):
        yield Flow(t, src, dst, number, None, outcome)
        return
    for delay, bit in copies_of(outcome):
        fate = "damaged" if bit is not None else "" if isfinite(delay) else "kept"
        yield Flow(t, src, dst, number, t + max(delay, least) if isfinite(delay) else None, fate)


def _implied(record: RunRecord, since: float, until: float) -> Iterator[Flow]:
    T = record.info.T_c
    for agent in record.agents:
        last: dict[str, tuple[int, int]] = {}
        for decision in record.decisions(agent, since=max(0.0, since - T), until=until + 2 * T):
            if not decision.measurement_age and since - 1e-9 <= decision.t <= until + 1e-9:
                yield Flow(decision.t, PLANT, agent, decision.tick, decision.t)
            for each in decision.neighbours:
                state = each.state
                if state is None or last.get(each.name) == (state.epoch, state.seq):
                    continue
                if (each.name in last or state.t >= decision.t - 1.5 * T) and since - 1e-9 <= state.t <= until + 1e-9:
                    yield Flow(state.t, each.name, agent, state.seq, decision.t)
                last[each.name] = state.epoch, state.seq
    for message in record.messages(since=since, until=until, kind="State"):
        yield Flow(message.t, message.sender, PLANT, message.number, message.t)


def _noted(record: RunRecord, since: float, until: float) -> Iterator[Flow]:
    """Yield the messages of real time as their receivers noted them; clocks of one host agree."""
    everybody = (*record.agents, PLANT)
    sent = {}  # when (s, monotonic), by the journal of the sender: the plant notes states too, but not when
    for sender in everybody:
        for entry in record.entries(sender, since=since, until=until):
            if isinstance(entry, SentMessage) and entry.at is not None and kind_of(entry.key) in EACH_TICK:
                message = sound(entry.payload)
                if message is not None:
                    sent[entry.key, message.epoch, message.seq] = entry.at
    speed = record.info.agents[0].speed if record.info.agents else 1.0
    for receiver in everybody:
        for heard in record.heard(receiver, since=since, until=until):
            if heard.kind not in (State.__name__, Measurement.__name__):
                continue
            begun = sent.get((heard.key, heard.epoch, heard.number))
            way = 0.0 if begun is None or heard.at is None else max(0.0, heard.at - begun)
            yield Flow(heard.t, heard.sender, receiver, heard.number, heard.t + way * speed, heard.rejected)
