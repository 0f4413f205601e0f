"""links.csv: one row for each copy of a message, which any reader of CSV takes apart as it was written."""

import csv
import json
import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import pytest
from msgspec.structs import replace

from gridpeers.netem.ledger import LinkCounts, LinkTrace
from gridpeers.netem.models.medium import Corrupt, Duplicate
from gridpeers.netem.receiver import Receiver
from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem
from gridpeers.scenarios.emulation.link_data import report_data
from gridpeers.scenarios.results import case_tables
from gridpeers.scenarios.results.case_tables import LINKS, write_tables
from gridpeers.scenarios.results.history import History
from gridpeers.scenarios.results.link_record import LinkRecord
from gridpeers.scenarios.results.record import Recorder
from gridpeers.wire.messages import LinkReport
from tests.unit.scenarios.results.test_record import row, telemetry

NO_ROWS = History.of((), b"")


def test_every_row_of_links_csv_has_the_header_s_columns_whatever_befell_the_message(tmp_path: Path) -> None:
    """Lost, duplicated and corrupted messages are read back by a CSV reader with the fate that they had."""
    fault = Fault(on="inv1 -> inv2", loss=0.2, duplicate=Duplicate(p=0.5), corrupt=Corrupt(p=0.5), delay=0.1)
    receiver = Receiver("inv2", Netem(seed=3, links=(fault,)), {"inv1": "MG1", "inv2": "MG1"})
    for k in range(60):
        receiver.offer("inv1", k, 0.02 * k, 0.02 * k, bytes(100))
    with Recorder(tmp_path / "IV") as recorder:
        recorder(telemetry((row(0.0),)))
        for data in report_data(receiver.take_trace(), receiver.counts(), receiver.trace_sha256):
            recorder(LinkReport(sender="inv2", epoch=1, seq=0, t=1.2, data=data))
        record = recorder.finish(0.0, 0.02).links

    files = {path.name for path in (tmp_path / "IV").iterdir()}
    assert files == {"history.csv", "events.csv", "links.csv", "links.json"}
    assert json.loads((tmp_path / "IV" / "links.json").read_text())["accounts"][0]["sent"] == 60
    assert next(record.lines()).startswith("emulated links: 60 messages over 1 links")
    with (tmp_path / "IV" / "links.csv").open(newline="") as file:
        rows = list(csv.DictReader(file, strict=True))
    assert tuple(rows[0]) == LINKS
    assert {len(each) for each in rows} == {len(LINKS)}  # DictReader keeps what is too much under the key None
    found = {(int(each["seq"]), each["delay_s"], each["fate"]) for each in rows}
    expected = set()
    for trace in record.traces:
        for seq, outcome in zip(trace.seq, trace.outcome, strict=True):
            if isinstance(outcome, str):
                expected.add((seq, "", outcome))
                continue
            copies = outcome if isinstance(outcome, tuple) else ((outcome, None),)
            for copy, (delay_s, bit) in enumerate(copies):
                flipped = "" if bit is None else f", bit {bit} flipped"
                expected.add((seq, str(delay_s), ("copy" if copy else "passed") + flipped))
    assert found == expected
    assert all(any(f"{kind}, bit" in each["fate"] for each in rows) for kind in ("passed", "copy"))


def test_the_line_of_the_report_says_whose_states_were_false(tmp_path: Path) -> None:
    """A link that lies drops nothing, and its run is none of a sound network; links.json has the number too."""
    record = LinkRecord()
    counts = LinkCounts(sent=50, duplicated=0, delivered=50, dropped={}, corrupted=0, in_flight=0)
    for receiver, lies in (("inv1", 20), ("inv4", 22)):
        of = {"inv2": replace(counts, lies=lies), "inv3": counts}
        for data in report_data((), of, ""):
            record(LinkReport(sender=receiver, epoch=1, seq=0, t=0.0, data=data))

    record.write(tmp_path)
    (line,) = record.lines()
    assert line == (
        "emulated links: 200 messages over 4 links, dropped: none, false states: 42 of inv2 (links.json, links.csv)"
    )
    accounts = json.loads((tmp_path / "links.json").read_text())["accounts"]
    assert [each.get("lies") for each in accounts] == [20, 22, None, None]


def test_verdicts_are_sorted_by_link_and_take_no_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run of hours with faults has millions of them, reported as they come; equal runs give equal files."""
    monkeypatch.setattr(case_tables, "_SPOOL", 10_000)

    def reported() -> Iterator[LinkTrace]:
        for first in range(0, 20_000, 100):
            for link in (("inv3", "inv1"), ("inv1", "inv2")):
                seq = tuple(range(first, first + 100))
                yield LinkTrace(*link, seq, tuple(0.02 * k for k in seq), ("loss", *[0.01] * 99))

    tracemalloc.start()
    write_tables(tmp_path, NO_ROWS, (), reported())
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    with (tmp_path / "links.csv").open(newline="") as file:
        written = [(row["src"], row["dst"], int(row["seq"])) for row in csv.DictReader(file)]

    assert peak < 300_000
    assert written == [("inv1", "inv2", k) for k in range(20_000)] + [("inv3", "inv1", k) for k in range(20_000)]
    assert {path.name for path in tmp_path.iterdir()} == {"history.csv", "events.csv", "links.csv"}
