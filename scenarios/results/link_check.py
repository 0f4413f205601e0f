"""Whether emulated links did what they were told: configured beside realised, in links.json and in the report."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from netem.check.rows import Row
from netem.check.verify import verify
from netem.spec.change import Change, schedule_of
from netem.spec.fault import Span
from netem.spec.netem import Netem
from netem.spec.pattern import Link
from scenarios.results.link_records import LinkRecord
from scenarios.results.run_files import write_whole
from wire.messages import PLANT


class LinkCheck:
    """The self-check of one case.

    Parameters
    ----------
    record : LinkRecord
        What the links did.
    netem : Netem
        What they were told; partitions by island resolved.
    microgrids : Mapping[str, str]
        Microgrid of every inverter that may take part.
    changes : Sequence[Change], optional
        What they were told while the run went on.
    """

    def __init__(
        self, record: LinkRecord, netem: Netem, microgrids: Mapping[str, str], changes: Sequence[Change] = ()
    ) -> None:
        self._record = record
        spans = _spans(record, netem, microgrids, changes)
        counts = {Link(*link): counts for link, counts in record.counts.items()}
        found = verify(record.traces, spans, netem.seed, counts)
        self.rows: tuple[Row, ...] = found.rows
        self.warnings: tuple[str, ...] = found.warnings
        """What chance does not explain, and accounts that do not close."""
        self.failures = tuple(sorted(record.failures))
        """Faults of somebody's own that failed."""

    def to_json(self) -> str:
        """Return the text of links.json: the hash of all verdicts, the accounts of every link, every test."""
        counts = [
            {
                "src": src,
                "dst": dst,
                "sent": book.sent,
                "duplicated": book.duplicated,
                "delivered": book.delivered,
                "dropped": book.dropped,
                "corrupted": book.corrupted,
                "in_flight": book.in_flight,
            }
            for (src, dst), book in sorted(self._record.counts.items())
        ]
        tests = [row._asdict() for row in self.rows]
        whole = {"trace_sha256": self._record.sha256, "accounts": counts, "tests": tests}
        whole |= {"failures": list(self.failures)} if self.failures else {}
        return json.dumps(whole, indent=1, default=str) + "\n"

    def write(self, folder: Path) -> list[str]:
        """Write links.csv and links.json; sentences for the report."""
        self._record.write(folder / "links.csv")
        write_whole(folder / "links.json", self.to_json())
        return list(self.lines())

    def lines(self) -> Iterable[str]:
        """Return the sentences for the report."""
        books = [book for book in self._record.counts.values() if book.sent]
        sent = sum(book.sent for book in books)
        dropped: Counter[str] = Counter()
        for book in books:
            dropped.update(book.dropped)
        of = ", ".join(f"{reason} {_share(count, sent)}" for reason, count in dropped.most_common()) or "none"
        tested = [row for row in self.rows if row.ok is not None]
        failed = f"{len(tested)} tests, {len(self.warnings) or 'none'} failed" if tested else "nothing that it can test"
        yield (
            f"emulated links: {sent} messages over {len(books)} links, dropped: {of}; self-check: {failed} "
            "(links.json, links.csv)"
        )
        yield from (f"WARNING: {warning}" for warning in self.warnings)
        if self.failures:
            more = f" (and {len(self.failures) - 1} more of this kind, links.json)" if len(self.failures) > 1 else ""
            yield f"WARNING: {self.failures[0]}{more}"


def _share(part: int, whole: int) -> str:
    return f"{100.0 * part / whole:.2f} %" if whole else "0 %"


def _spans(
    record: LinkRecord, netem: Netem, microgrids: Mapping[str, str], changes: Sequence[Change]
) -> dict[Link, tuple[Span, ...]]:
    """Return what each link was told over which anything was sent."""
    names = (*microgrids, PLANT)
    links = [Link(src, dst) for src in names for dst in names if (src, dst) in record.counts]
    if not changes:
        return {link: spans for link in links if (spans := netem.spans(link, microgrids))}
    return {link: spans for link in links if (spans := schedule_of(link, netem, changes, microgrids).flat())}
