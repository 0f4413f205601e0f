"""What the emulated links of one case did: every verdict as links.csv, the counts, and one hash of all."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from io import StringIO
from pathlib import Path

import msgspec

from netem.ledger import LinkCounts, LinkTrace, Outcome, combined
from scenarios.emulation.report import LinkBook, decode_book
from scenarios.results.folder import write_whole
from wire.messages import LinkReport

COLUMNS = ("src", "dst", "seq", "t_s", "delay_s", "fate")
"""Of links.csv: one row for each copy of a message, or for a message that was dropped."""


class LinkRecord:
    """Takes the reports of one case as they come."""

    def __init__(self) -> None:
        self.traces: list[LinkTrace] = []
        """Verdicts, in parts."""
        self.counts: dict[tuple[str, str], LinkCounts] = {}
        """Of each link (src, dst) how its messages fared."""
        self.garbled = 0
        """Reports that could not be read."""
        self._sha256: dict[str, str] = {}

    def __call__(self, report: LinkReport) -> None:
        """Take one part of a receiver's book."""
        try:
            book: LinkBook = decode_book(report.data)
        except msgspec.DecodeError:
            self.garbled += 1
            return
        self.traces += book.traces
        self.counts.update({(src, report.sender): counts for src, counts in book.counts.items()})
        if book.sha256:
            self._sha256[report.sender] = book.sha256

    @property
    def sha256(self) -> str:
        """Hash (hex) of all verdicts of all links, whatever the order in which they were reported."""
        return combined(self._sha256)

    def by_link(self) -> dict[tuple[str, str], LinkTrace]:
        """All verdicts of each link (src, dst) in one."""
        found: dict[tuple[str, str], LinkTrace] = {}
        for part in self.traces:
            key = part.src, part.dst
            before = found.get(key)
            found[key] = (
                part
                if before is None
                else LinkTrace(*key, before.seq + part.seq, before.t + part.t, before.outcome + part.outcome)
            )
        return dict(sorted(found.items()))

    def write(self, path: Path) -> None:
        """Write links.csv."""
        text = StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(COLUMNS)
        for trace in self.by_link().values():
            writer.writerows(_rows(trace))
        write_whole(path, text.getvalue())


def _rows(trace: LinkTrace) -> Iterator[tuple[object, ...]]:
    for seq, t, outcome in zip(trace.seq, trace.t, trace.outcome, strict=True):
        for delay_s, fate in _fates(outcome):
            yield trace.src, trace.dst, seq, t, delay_s, fate


def _fates(outcome: Outcome) -> Iterator[tuple[object, str]]:
    if isinstance(outcome, str):
        yield "", outcome
    elif isinstance(outcome, float | int):
        yield float(outcome), "passed"
    else:
        for copy, (delay_s, bit) in enumerate(outcome):
            yield delay_s, ("copy" if copy else "passed") + ("" if bit is None else f", bit {bit} flipped")
