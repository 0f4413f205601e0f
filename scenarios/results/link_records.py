"""What the emulated links of one case did: every verdict as links.csv, the counts, and one hash of all."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from io import StringIO
from pathlib import Path

import msgspec

from netem.ledger import LinkCounts, LinkTrace, Outcome, combined
from scenarios.emulation.link_reports import data_of
from scenarios.results.run_files import write_whole
from wire.messages import LinkReport

COLUMNS = ("src", "dst", "seq", "t_s", "delay_s", "fate")
"""Of links.csv: one row for each copy of a message, or for a message that was dropped."""


PARTIAL = "links.partial"
"""Name of the verdicts' file while the case runs; links.csv takes its place."""


class LinkRecord:
    """Takes the reports of one case as they come.

    Parameters
    ----------
    folder : Path, optional
        The case's folder, for verdicts until the case has ended: they are as many as messages. Else they are kept in
        memory.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._file = None if folder is None else folder / PARTIAL
        self._traces: list[LinkTrace] = []
        self.counts: dict[tuple[str, str], LinkCounts] = {}
        """Of each link (src, dst) how its messages fared."""
        self.garbled = 0
        """Reports that could not be read."""
        self.failures: list[str] = []
        """Sentences on faults of somebody's own that failed."""
        self._sha256: dict[str, str] = {}

    def __call__(self, report: LinkReport) -> None:
        """Take one part of a receiver's book."""
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

    @property
    def traces(self) -> list[LinkTrace]:
        """Verdicts, in parts."""
        return list(self._parts())

    def _keep(self, traces: tuple[LinkTrace, ...]) -> None:
        if self._file is None:
            self._traces += traces
        elif traces:
            with self._file.open("ab") as file:
                for trace in traces:
                    encoded = _encode(trace)
                    file.write(len(encoded).to_bytes(4, "little") + encoded)

    def _parts(self) -> Iterator[LinkTrace]:
        yield from self._traces
        if self._file is not None and self._file.exists():
            with self._file.open("rb") as file:
                while size := file.read(4):
                    yield _decode(file.read(int.from_bytes(size, "little")))

    @property
    def sha256(self) -> str:
        """Hash (hex) of all verdicts of all links, whatever the order in which they were reported."""
        return combined(self._sha256)

    def by_link(self) -> dict[tuple[str, str], LinkTrace]:
        """Return all verdicts of each link (src, dst) in one."""
        parts: dict[tuple[str, str], list[LinkTrace]] = {}
        for part in self._parts():
            parts.setdefault((part.src, part.dst), []).append(part)
        return {
            link: LinkTrace(
                *link,
                tuple(seq for part in of for seq in part.seq),
                tuple(t for part in of for t in part.t),
                tuple(outcome for part in of for outcome in part.outcome),
            )
            for link, of in sorted(parts.items())
        }

    def write(self, path: Path) -> None:
        """Write links.csv."""
        text = StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(COLUMNS)
        for trace in self.by_link().values():
            writer.writerows(_rows(trace))
        write_whole(path, text.getvalue())
        if self._file is not None:
            self._file.unlink(missing_ok=True)
            self._file, self._traces = None, []


_encode = msgspec.msgpack.Encoder().encode
_decode = msgspec.msgpack.Decoder(LinkTrace).decode


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
