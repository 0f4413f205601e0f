"""links.csv: one row for each copy of a message, which any reader of CSV takes apart as it was written."""

import csv
from pathlib import Path

from netem.models.corrupt import Corrupt
from netem.models.duplicate import Duplicate
from netem.receiver import Receiver
from netem.spec.fault import Fault
from netem.spec.netem import Netem
from scenarios.emulation.report import parts
from scenarios.results.links import COLUMNS, LinkRecord
from wire.messages import LinkReport


def test_every_row_of_links_csv_has_the_header_s_columns_whatever_befell_the_message(tmp_path: Path) -> None:
    """Lost, duplicated and corrupted messages are read back by a CSV reader with the fate that they had."""
    fault = Fault(on="inv1 -> inv2", loss=0.2, duplicate=Duplicate(p=0.5), corrupt=Corrupt(p=0.5), delay=0.1)
    receiver = Receiver("inv2", Netem(seed=3, links=(fault,)), {"inv1": "MG1", "inv2": "MG1"})
    for k in range(60):
        receiver.offer("inv1", k, 0.02 * k, 0.02 * k, bytes(100))
    record = LinkRecord()
    for data in parts(receiver.take_trace(), receiver.counts(), receiver.trace_sha256):
        record(LinkReport(sender="inv2", incarnation=1, seq=0, t=1.2, data=data))
    record.write(tmp_path / "links.csv")

    with (tmp_path / "links.csv").open(newline="") as file:
        rows = list(csv.DictReader(file, strict=True))
    assert tuple(rows[0]) == COLUMNS
    assert {len(row) for row in rows} == {len(COLUMNS)}  # DictReader keeps what is too much under the key None
    found = {(int(row["seq"]), row["delay_s"], row["fate"]) for row in rows}
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
    assert any("passed, bit" in row["fate"] for row in rows)
    assert any("copy, bit" in row["fate"] for row in rows)
