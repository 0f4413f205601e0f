"""links.csv: one row for each copy of a message, which any reader of CSV takes apart as it was written."""

import csv
import json
import tracemalloc
from pathlib import Path

import pytest
from msgspec.structs import replace

from gridpeers.netem.ledger import LinkCounts
from gridpeers.netem.models.medium import Corrupt, Duplicate
from gridpeers.netem.receiver import Receiver
from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem
from gridpeers.scenarios.emulation.link_data import report_data
from gridpeers.scenarios.results.link_record import COLUMNS, LinkRecord
from gridpeers.scenarios.results.record import Recorder
from gridpeers.wire.messages import LinkReport, Telemetry
from tests.toy.toy_runs import by_link


def test_every_row_of_links_csv_has_the_header_s_columns_whatever_befell_the_message(tmp_path: Path) -> None:
    """Lost, duplicated and corrupted messages are read back by a CSV reader with the fate that they had."""
    fault = Fault(on="inv1 -> inv2", loss=0.2, duplicate=Duplicate(p=0.5), corrupt=Corrupt(p=0.5), delay=0.1)
    receiver = Receiver("inv2", Netem(seed=3, links=(fault,)), {"inv1": "MG1", "inv2": "MG1"})
    for k in range(60):
        receiver.offer("inv1", k, 0.02 * k, 0.02 * k, bytes(100))
    record = LinkRecord()
    for data in report_data(receiver.take_trace(), receiver.counts(), receiver.trace_sha256):
        record(LinkReport(sender="inv2", epoch=1, seq=0, t=1.2, data=data))
    record.write(tmp_path)

    with (tmp_path / "links.csv").open(newline="") as file:
        rows = list(csv.DictReader(file, strict=True))
    assert tuple(rows[0]) == COLUMNS
    assert {len(row) for row in rows} == {len(COLUMNS)}  # DictReader keeps what is too much under the key None
    found = {(int(row["seq"]), row["delay_s"], row["fate"]) for row in rows}
    expected = set()
    for trace in record.traces():
        for seq, outcome in zip(trace.seq, trace.outcome, strict=True):
            if isinstance(outcome, str):
                expected.add((seq, "", outcome))
                continue
            copies = outcome if isinstance(outcome, tuple) else ((outcome, None),)
            for copy, (delay_s, bit) in enumerate(copies):
                flipped = "" if bit is None else f", bit {bit} flipped"
                expected.add((seq, str(delay_s), ("copy" if copy else "passed") + flipped))
    assert found == expected
    assert any("passed, bit" in row["fate"] for row in rows)
    assert any("copy, bit" in row["fate"] for row in rows)


@pytest.mark.parametrize("finished", [True, False])
def test_the_recorder_of_a_case_writes_the_files_of_its_links(tmp_path: Path, finished: bool) -> None:
    """Telemetry and link reports go into one record; a case that broke keeps the fates of its messages too."""
    receiver = Receiver("inv2", Netem(seed=3, links=(Fault(on="* -> inv2", loss=0.2),)), {"inv1": "MG1", "inv2": "MG1"})
    receiver.offer("inv1", 0, 0.0, 0.0, b"state")
    telemetry = Telemetry(
        sender="plant",
        epoch=1,
        seq=0,
        t=0.0,
        inverters=("inv1",),
        rows=((0.0,) * 7,),
        events=(),
        final=True,
        outcome="",
        reproducible=True,
    )
    with Recorder(tmp_path / "IV") as recorder:
        recorder(telemetry)
        for data in report_data(receiver.take_trace(), receiver.counts(), receiver.trace_sha256):
            recorder(LinkReport(sender="inv2", epoch=1, seq=0, t=0.0, data=data))
        recorded = recorder.finish(0.0, 0.02) if finished else None

    files = {path.name for path in (tmp_path / "IV").iterdir()}
    assert files == {"history.csv" if finished else "history.partial.csv", "events.csv", "links.csv", "links.json"}
    assert json.loads((tmp_path / "IV" / "links.json").read_text())["accounts"][0]["sent"] == 1
    assert recorded is None or recorded.link_lines[0].startswith("emulated links: 1 messages over 1 links")


def test_the_line_of_the_report_says_whose_states_were_false(tmp_path: Path) -> None:
    """A link that lies drops nothing, and its run is none of a sound network; links.json has the number too."""
    record = LinkRecord()
    counts = LinkCounts(sent=50, duplicated=0, delivered=50, dropped={}, corrupted=0, in_flight=0)
    for receiver, lies in (("inv1", 20), ("inv4", 22)):
        of = {"inv2": replace(counts, lies=lies), "inv3": counts}
        for data in report_data((), of, ""):
            record(LinkReport(sender=receiver, epoch=1, seq=0, t=0.0, data=data))

    (line,) = record.write(tmp_path)
    assert line == (
        "emulated links: 200 messages over 4 links, dropped: none, false states: 42 of inv2 (links.json, links.csv)"
    )
    accounts = json.loads((tmp_path / "links.json").read_text())["accounts"]
    assert [each.get("lies") for each in accounts] == [20, 22, None, None]


def test_verdicts_on_disk_are_those_in_memory_and_take_no_memory(tmp_path: Path) -> None:
    """A run of hours with faults has millions of verdicts: they are read back once it has ended, and give way then."""
    receiver = Receiver("inv2", Netem(seed=3, links=(Fault(on="* -> inv2", loss=0.2),)), {"inv1": "MG1", "inv2": "MG1"})
    in_memory, on_disk = LinkRecord(), LinkRecord(tmp_path)
    tracemalloc.start()
    for first in range(0, 20_000, 100):
        for k in range(first, first + 100):
            receiver.offer("inv1", k, 0.02 * k, 0.02 * k, b"state")
            receiver.due(0.02 * k)
        for data in report_data(receiver.take_trace(), receiver.counts(), receiver.trace_sha256):
            on_disk(LinkReport(sender="inv2", epoch=1, seq=0, t=1.2, data=data))
            if first < 5_000:
                in_memory(LinkReport(sender="inv2", epoch=1, seq=0, t=1.2, data=data))
            elif first == 5_000:
                before, _ = tracemalloc.get_traced_memory()
    grown = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    (mine,), (theirs,) = by_link(on_disk).values(), by_link(in_memory).values()
    tracemalloc.start()
    on_disk.write(tmp_path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    with (tmp_path / "links.csv").open(newline="") as file:
        written = [int(row["seq"]) for row in csv.DictReader(file)]

    assert max(grown, peak) < 300_000
    assert written == list(range(20_000))
    assert mine.outcome[:5_000] == theirs.outcome
    assert mine.seq == tuple(range(20_000))
    assert {path.name for path in tmp_path.iterdir()} == {"links.csv", "links.json"}
