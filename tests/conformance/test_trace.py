"""The traces of a record have every message of the run, and none besides."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from gridpeers.lab.trace import Flow, flows
from gridpeers.scenarios.record.record_reader import RunRecord
from tests.command_line import invoke
from tests.record.recorded_runs import recorded_run

LOSSY = """
seed = 7
[time]
end_s = 0.5
[case.lossy]
secondary = "all"
graph = "full"
[[link]]
on = "* <-> *"
loss = 0.2
delay = 0.03
duplicate = 0.1
[[link]]
on = "inv4 <-> inv7"
cut = true
from_s = 0.2
to_s = 0.3
"""

CALM = '[time]\nend_s = 0.4\n[case.calm]\nsecondary = "all"\ngraph = "ring"\n'


def record_of(folder: Path, text: str, case: str) -> RunRecord:
    (folder / f"{case}.toml").write_text(text, encoding="utf-8")
    return recorded_run(folder / f"{case}.toml", case, folder / case)


@pytest.fixture(scope="module")
def lossy(tmp_path_factory: pytest.TempPathFactory) -> RunRecord:
    """Losses, delays, copies and a cut on all links between agents."""
    return record_of(tmp_path_factory.mktemp("lossy"), LOSSY, "lossy")


@pytest.fixture(scope="module")
def calm(tmp_path_factory: pytest.TempPathFactory) -> RunRecord:
    """A ring without emulated links: 20 ticks of nine agents."""
    return record_of(tmp_path_factory.mktemp("calm"), CALM, "calm")


def ledger(record: RunRecord) -> tuple[int, int]:
    """Copies that arrived or were on their way at the end, and messages dropped, by the accounts of all links."""
    counts = record.link_counts()
    return (
        sum(of.delivered + of.in_flight for of in counts.values()),
        sum(sum(of.dropped.values()) for of in counts.values()),
    )


def between_agents(found: list[Flow]) -> list[Flow]:
    """Flows that neither begin nor end at the plant."""
    return [flow for flow in found if "plant" not in (flow.src, flow.dst)]


def test_flows_are_those_of_the_ledger(lossy: RunRecord) -> None:
    """Arrivals, losses and delays equal those of the links' ledgers."""
    found = between_agents(flows(lossy))

    arrived = [flow for flow in found if flow.arrived is not None]
    assert (len(arrived), len(found) - len(arrived)) == ledger(lossy)
    assert Counter(flow.fate for flow in found if flow.arrived is None).keys() == {"loss", "cut"}
    assert {round(flow.arrived - flow.sent, 9) for flow in arrived if flow.arrived is not None} == {0.03}
    assert len({(flow.src, flow.dst) for flow in found}) == 72


def test_without_emulated_links_each_state_reaches_its_neighbours(calm: RunRecord) -> None:
    """Each tick of a ring: two neighbours one period later, the plant at once, and a measurement for each agent."""
    found = flows(calm)

    states = between_agents(found)
    assert len(states) == 9 * 2 * 19
    assert {round(flow.arrived - flow.sent, 9) for flow in states if flow.arrived is not None} == {0.02}
    assert sum(flow.dst == "plant" for flow in found) == sum(flow.src == "plant" for flow in found) == 9 * 20
    window = flows(calm, 0.1, 0.2)
    assert window == [flow for flow in found if 0.1 - 1e-9 <= flow.sent <= 0.2 + 1e-9]


def test_the_perfetto_trace(lossy: RunRecord, tmp_path: Path) -> None:
    """Read back by the package's protos: an arrow for each message that arrived, its ends in order, all counters."""
    protos = pytest.importorskip("perfetto.protos.perfetto.trace.perfetto_trace_pb2")

    code, printed = invoke("trace", str(lossy.path), "--out", str(tmp_path / "it.pftrace"))

    assert code == 0
    trace = protos.Trace.FromString((tmp_path / "it.pftrace").read_bytes())
    events = [packet for packet in trace.packet if packet.HasField("track_event")]
    begins = {flow: packet.timestamp for packet in events for flow in packet.track_event.flow_ids}
    ends = {flow: packet.timestamp for packet in events for flow in packet.track_event.terminating_flow_ids}
    arrows = sum(flow.arrived is not None for flow in flows(lossy))
    assert f"{arrows} messages" in printed
    assert len(begins) == len(ends) == arrows == ledger(lossy)[0] + 2 * 9 * 25
    assert begins.keys() == ends.keys()
    assert all(begins[flow] <= ends[flow] for flow in begins)
    lost = [packet for packet in events if " lost: " in packet.track_event.name]
    assert len(lost) == ledger(lossy)[1]
    tracks = {d.track_descriptor.uuid: d.track_descriptor for d in trace.packet if d.HasField("track_descriptor")}
    assert {d.process.process_name for d in tracks.values() if d.HasField("process")} == {
        "run", "plant", *lossy.agents,
    }  # fmt: skip
    counters = Counter(
        tracks[packet.track_event.track_uuid].name
        for packet in events
        if packet.track_event.type == protos.TrackEvent.TYPE_COUNTER
    )
    rows = len(lossy.physics().t)
    assert counters == {"f": 9 * rows, "P": 9 * rows, "MPSI": rows}
    assert sum(packet.track_event.name == "cut" for packet in events) >= 2
    stamps = [packet.timestamp for packet in trace.packet]
    assert stamps == sorted(stamps)
