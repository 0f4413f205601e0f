"""The messages of a run as flows: from whom to whom, when sent and when arrived, or why not; as a Perfetto trace."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import groupby
from math import inf, isfinite
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gridpeers.netem.ledger import Outcome, copies_of
from gridpeers.scenarios.console import in_order
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.scenarios.results.run_files import write_whole
from gridpeers.scenarios.results.sharing_index import sharing_index
from gridpeers.wire.codec import sound
from gridpeers.wire.journal import EACH_TICK, MessageReference, ReceivedMessage, SentMessage, kind_of
from gridpeers.wire.messages import PLANT, State


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


def flows(record: RunRecord, since: float = 0.0, until: float = inf) -> list[Flow]:
    """Return the measurements and states of a run that were sent between two run times (s), in the order of sending.

    Of emulated links these are their verdicts, from the first one on. In simulated time a state arrives at a neighbour
    with the decision that can first use it, one period later or after its delay, and at the plant at once, like
    measurements. In real time they arrive when the receiver noted them.
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
    others = _noted if record.info.clock == "realtime" else _implied
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
    for state in record.messages(State, since=since, until=until):
        yield Flow(state.t, state.sender, PLANT, state.seq, state.t)


def _noted(record: RunRecord, since: float, until: float) -> Iterator[Flow]:
    """Yield the messages of real time as their receivers noted them; clocks of one host agree."""
    index, speed = record.index, record.info.plant.speed
    noted = [each for part in index.near(since, until) for each in index.part(part).entries]
    sent: dict[tuple[str, int, int], float] = {}
    """When (s, monotonic), by the journal of the sender: the plant notes states too, but not when."""
    for _, entry in noted:
        if isinstance(entry, SentMessage) and entry.at is not None and kind_of(entry.key) in EACH_TICK:
            message = sound(entry.payload)
            if message is not None:
                sent[entry.key, message.epoch, message.seq] = entry.at
    for journal, entry in noted:
        if not isinstance(entry, MessageReference | ReceivedMessage) or kind_of(entry.key) not in EACH_TICK:
            continue
        heard = sound(entry.payload) if isinstance(entry, ReceivedMessage) else index.named_by(entry, journal.t)
        if heard is None:
            continue
        t = journal.t if entry.rejected else heard.t  # of a rejected one any time may be said
        if since - 1e-9 <= t <= until + 1e-9:
            begun = sent.get((entry.key, heard.epoch, heard.seq))
            way = 0.0 if begun is None or entry.at is None else max(0.0, entry.at - begun)
            yield Flow(t, heard.sender, journal.sender, heard.seq, t + way * speed, entry.rejected)


# -------------------------------------------------------------------- Perfetto trace


CUTS = ("cut", "partition", "flap")  # Fates that are drawn as a slice too: nothing passes for a time


class PerfettoTrace:
    """Tracks and events in the format `perfetto.protos.Trace`, which https://ui.perfetto.dev opens."""

    def __init__(self) -> None:
        from perfetto.protos.perfetto.trace import perfetto_trace_pb2 as protos

        self._protos: Any = protos
        self._packets: list[tuple[int, int, Any]] = []
        self._tracks: dict[tuple[str, ...], int] = {}

    def track(self, *path: str, unit: str = "", process: int | None = None) -> int:
        known = self._tracks.get(path)
        if known is not None:
            return known
        uuid = self._tracks[path] = len(self._tracks) + 1
        packet = self._packet(0, -1)
        descriptor = packet.track_descriptor
        descriptor.uuid, descriptor.name = uuid, path[-1]
        if len(path) > 1:
            descriptor.parent_uuid = self._tracks[path[:1]]
        elif process is not None:
            descriptor.process.pid, descriptor.process.process_name = process, path[0]
        if unit:
            descriptor.counter.unit_name = unit
        return uuid

    def event(
        self, t: float, track: int, kind: str, name: str = "", *, begins: Iterable[int] = (), ends: Iterable[int] = ()
    ) -> Any:
        """Add an event: TYPE_SLICE_BEGIN, TYPE_SLICE_END or TYPE_INSTANT, with the flows that begin and end there."""
        packet = self._packet(t, 0 if kind == "TYPE_SLICE_END" else 1)
        event = packet.track_event
        event.type, event.track_uuid = getattr(self._protos.TrackEvent, kind), track
        if name:
            event.name = name
        event.flow_ids.extend(begins)
        event.terminating_flow_ids.extend(ends)
        return event

    def counter(self, t: float, track: int, value: float) -> None:
        if isfinite(value):
            event = self._packet(t, 1).track_event
            event.type, event.track_uuid = self._protos.TrackEvent.TYPE_COUNTER, track
            event.double_counter_value = value

    def write(self, path: Path) -> None:
        self._packets.sort(key=lambda item: item[:2])
        if self._packets:
            self._packets[0][2].sequence_flags = self._protos.TracePacket.SEQ_INCREMENTAL_STATE_CLEARED
        parts = (self._protos.Trace(packet=[packet]).SerializeToString() for _, _, packet in self._packets)
        write_whole(path, b"".join(parts))

    def _packet(self, t: float, order: int) -> Any:
        packet = self._protos.TracePacket(timestamp=round(t * 1e9), trusted_packet_sequence_id=1)  # in ns
        self._packets.append((packet.timestamp, order, packet))
        return packet


def write_perfetto_trace(record: RunRecord, path: Path) -> int:
    """Write tracks of agents and links, an arrow for each message, and counters of the physics; return the arrows.

    A track of a link has an instant for each arrival, at the end of the arrow from its sender, and for each loss one
    without an arrow. A cut is a slice from its first lost message to its last.
    """
    trace = PerfettoTrace()
    for number, name in enumerate(("run", PLANT, *in_order(record.agents)), 1):
        trace.track(name, process=number)
    found = flows(record)
    arrows = _add_messages(trace, found, record.info.T_c)
    _add_cuts(trace, found, record.info.T_c)
    _add_physics(trace, record)
    events = trace.track("run", "events")
    for event in record.events():
        trace.event(event.t, events, "TYPE_INSTANT", event.text)
    trace.write(path)
    return arrows


def _add_messages(trace: PerfettoTrace, found: list[Flow], T_c: float) -> int:
    arrow = 0
    for (sent, src), together in groupby(found, key=lambda flow: flow[:2]):
        ids = []
        numbers = set()
        for flow in together:
            numbers.add(flow.number)
            link = trace.track(flow.dst, f"from {src}")
            if flow.arrived is None:
                trace.event(sent, link, "TYPE_INSTANT", f"{flow.number} lost: {flow.fate}")
                continue
            arrow += 1
            ids.append(arrow)
            name = f"{flow.number}" + (f" rejected: {flow.fate}" if flow.fate else "")
            trace.event(flow.arrived, link, "TYPE_INSTANT", name, ends=(arrow,))
        own = trace.track(src, "sends")
        name = "measures" if src == PLANT else "decides"
        trace.event(sent, own, "TYPE_SLICE_BEGIN", f"{name} {min(numbers)}", begins=ids)
        trace.event(sent + 0.1 * T_c, own, "TYPE_SLICE_END")
    return arrow


def _add_cuts(trace: PerfettoTrace, found: list[Flow], T_c: float) -> None:
    by_link: dict[tuple[str, str], list[Flow]] = {}
    for flow in found:
        by_link.setdefault((flow.dst, flow.src), []).append(flow)
    for (dst, src), on_link in by_link.items():
        for fate, together in groupby(on_link, key=lambda flow: flow.fate):
            if fate in CUTS:
                cut = list(together)
                track = trace.track(dst, f"from {src}, cuts")
                trace.event(cut[0].sent, track, "TYPE_SLICE_BEGIN", fate)
                trace.event(cut[-1].sent + 0.5 * T_c, track, "TYPE_SLICE_END")


def _add_physics(trace: PerfettoTrace, record: RunRecord) -> None:
    history = record.physics()
    rated = {config.name: config.P_rated for config in record.info.agents}
    present = [name for name in history.inverters if name in rated]
    for name in present:
        column = history.inverters.index(name)
        f, P = trace.track(name, "f", unit="Hz"), trace.track(name, "P", unit="pu")
        for row, t in enumerate(history.t):
            trace.counter(float(t), f, float(history.f[row, column]))
            trace.counter(float(t), P, float(history.P[row, column]) / rated[name])
    configs = [record.info.agent(name) for name in history.inverters]
    s, m_p = (np.array([getattr(c, key, 1.0) for c in configs]) for key in ("P_rated", "m_p"))
    shares = np.array([c is not None for c in configs], bool)
    track = trace.track("run", "MPSI", unit="pu")
    for t, value in zip(history.t, sharing_index(history.P, s, m_p, history.present & shares), strict=True):
        trace.counter(float(t), track, float(value))
