"""A record as a Perfetto trace: tracks of agents and links, an arrow for each message, counters of the physics.

The format is `perfetto.protos.Trace`, written by the protos of the package `perfetto`; https://ui.perfetto.dev opens
it. A track of a link has an instant for each arrival, at the end of the arrow from its sender, and for each loss one
without an arrow. A cut is a slice from its first lost message to its last.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import groupby
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from gridpeers.lab.trace.flows import Flow, flows
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.scenarios.results.run_files import write_whole
from gridpeers.scenarios.results.sharing_index import sharing_index
from gridpeers.scenarios.short_texts import in_order
from gridpeers.wire.messages import PLANT

CUTS = ("cut", "partition", "flap")
"""Fates that are drawn as a slice too: nothing passes for a time."""


class PerfettoTrace:
    def __init__(self) -> None:
        from perfetto.protos.perfetto.trace import perfetto_trace_pb2 as protos

        self._protos: Any = protos
        self._packets: list[tuple[int, int, Any]] = []
        self._tracks: dict[tuple[str, ...], int] = {}

    def track(self, *path: str, unit: str = "", process: int | None = None) -> int:
        """Return the id of a track, by its process and its name; it is described when it is first asked for."""
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
        """Write the file, at once or not at all; raise OSError if that fails."""
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
