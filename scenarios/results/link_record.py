"""Record of the emulated links of one case: every verdict in links.csv, counts and one hash of all in links.json."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from io import SEEK_END, BytesIO
from itertools import chain
from pathlib import Path
from typing import BinaryIO

import msgspec

from gridpeers.netem.ledger import LinkCounts, LinkTrace, combined, copies_of
from gridpeers.scenarios.emulation.link_data import data_of
from gridpeers.scenarios.results.run_files import csv_text, write_whole
from gridpeers.wire.messages import LinkReport

COLUMNS = ("src", "dst", "seq", "t_s", "delay_s", "fate")
"""Columns of links.csv: one row for each copy of a message, or for a message that was dropped."""

PARTIAL = "links.partial"  # Name of the verdicts' file while the case runs; links.csv takes its place
_SIZE = 4  # Bytes of the size before each part in that file


class LinkRecord:
    """Record the link reports of one case.

    Verdicts are as many as messages: with a folder they are in a file there until the case has ended, not in memory.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._path = None if folder is None else folder / PARTIAL
        self._file: BinaryIO = BytesIO()
        self._parts: dict[tuple[str, str], list[int]] = {}
        """Places in the file of the verdicts of each link, as they were reported."""
        self.counts: dict[tuple[str, str], LinkCounts] = {}
        """Counts of the messages of each link (src, dst)."""
        self.garbled = 0
        """Reports that could not be read."""
        self.failures: list[str] = []
        """Sentences on plugged-in faults that failed."""
        self._sha256: dict[str, str] = {}

    def __call__(self, report: LinkReport) -> None:
        try:
            data = data_of(report)
        except msgspec.DecodeError:
            self.garbled += 1
            return
        self._keep(data.traces)
        self.failures += data.failures
        self.counts.update({(src, report.sender): counts for src, counts in data.counts.items()})
        if data.sha256:
            self._sha256[report.sender] = data.sha256

    def _keep(self, traces: tuple[LinkTrace, ...]) -> None:
        if traces and self._path is not None and not self._parts:
            self._file = self._path.open("w+b")
        self._file.seek(0, SEEK_END)
        for trace in traces:
            self._parts.setdefault((trace.src, trace.dst), []).append(self._file.tell())
            encoded = _encode(trace)
            self._file.write(len(encoded).to_bytes(_SIZE, "little") + encoded)
        self._file.flush()  # a run that is killed leaves its verdicts

    @property
    def sent(self) -> int:
        return sum(counts.sent for counts in self.counts.values())

    @property
    def sha256(self) -> str:
        """Hash (hex) of all verdicts of all links, whatever the order of the reports; "" if no message was sent."""
        return combined(self._sha256) if self.sent else ""

    @property
    def warnings(self) -> tuple[str, ...]:
        """Links whose messages are neither delivered, dropped nor in flight."""
        open_ = ((link, counts) for link, counts in self.counts.items() if not counts.closes)
        return tuple(f"{src} -> {dst}: the account does not close: {counts}" for (src, dst), counts in open_)

    def traces(self) -> Iterator[LinkTrace]:
        """Yield the verdicts in parts, link by link; only one part at a time is decoded."""
        for link in sorted(self._parts):
            for part in self._parts[link]:
                self._file.seek(part)
                yield _decode(self._file.read(int.from_bytes(self._file.read(_SIZE), "little")))

    def write(self, folder: Path) -> list[str]:
        """Write links.csv and links.json, and return the lines for the report; nothing if no message was sent."""
        if not self.sent:
            return []
        parts = chain([[COLUMNS]], map(_rows, self.traces()))
        write_whole(folder / "links.csv", map(csv_text, parts))  # part by part: an hour has hundreds of megabytes
        write_whole(folder / "links.json", self._json())
        if self._path is not None:
            self._file.close()
            self._path.unlink(missing_ok=True)
        return list(self._lines())

    def _json(self) -> str:
        counts = [{"src": src, "dst": dst, **msgspec.to_builtins(of)} for (src, dst), of in sorted(self.counts.items())]
        whole: dict[str, object] = {"trace_sha256": self.sha256, "accounts": counts}
        whole |= {"failures": sorted(self.failures)} if self.failures else {}
        return json.dumps(whole, indent=1, default=str) + "\n"

    def _lines(self) -> Iterator[str]:
        dropped: Counter[str] = Counter()
        lies: Counter[str] = Counter()
        for (src, _), counts in sorted(self.counts.items()):
            dropped.update(counts.dropped)
            lies[src] += counts.lies
        false = ", ".join(f"{count} of {src}" for src, count in lies.most_common() if count)
        false = f", false states: {false}" if false else ""
        shares = (f"{reason} {100.0 * count / self.sent:.2f} %" for reason, count in dropped.most_common())
        yield (
            f"emulated links: {self.sent} messages over {sum(of.sent > 0 for of in self.counts.values())} links, "
            f"dropped: {', '.join(shares) or 'none'}{false} (links.json, links.csv)"
        )
        yield from (f"WARNING: {warning}" for warning in self.warnings)
        if self.failures:
            first, *others = sorted(self.failures)
            more = f" (and {len(others)} more of this kind, links.json)" if others else ""
            yield f"WARNING: {first}{more}"


_encode = msgspec.msgpack.Encoder().encode
_decode = msgspec.msgpack.Decoder(LinkTrace).decode


def _rows(trace: LinkTrace) -> Iterator[tuple[object, ...]]:
    for seq, t, outcome in zip(trace.seq, trace.t, trace.outcome, strict=True):
        sent = trace.src, trace.dst, seq, t
        if isinstance(outcome, str):
            yield *sent, "", outcome
        for copy, (delay_s, bit) in enumerate(copies_of(outcome)):
            yield *sent, delay_s, ("copy" if copy else "passed") + ("" if bit is None else f", bit {bit} flipped")
