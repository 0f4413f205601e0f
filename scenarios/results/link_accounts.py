"""What became of the messages on the emulated links of one case: links.csv, links.json and lines of the report."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from scenarios.results.link_records import LinkRecord
from scenarios.results.run_files import write_whole

if TYPE_CHECKING:
    from netem.check.verify import Report


class LinkAccounts:
    """The accounts of one case's links.

    Parameters
    ----------
    record : LinkRecord
        The verdicts and counts of all links.
    check : Report, optional
        The result of `scenarios.results.link_self_check.self_check`, if the run was asked for one.
    """

    def __init__(self, record: LinkRecord, check: Report | None = None) -> None:
        self._record, self._check = record, check
        unclosed = (
            f"{src} -> {dst}: the account does not close: {counts}"
            for (src, dst), counts in record.counts.items()
            if not counts.closes
        )
        self.warnings: tuple[str, ...] = (*unclosed, *(check.warnings if check else ()))
        """Accounts that do not close; with a self-check, also what chance does not explain."""
        self.failures = tuple(sorted(record.failures))
        """Plugged-in faults that failed."""

    def to_json(self) -> str:
        """Return the text of links.json: the hash of all verdicts, the accounts of every link, the tests if any."""
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
        whole: dict[str, object] = {"trace_sha256": self._record.sha256, "accounts": counts}
        whole |= {"tests": [row._asdict() for row in self._check.rows]} if self._check else {}
        whole |= {"failures": list(self.failures)} if self.failures else {}
        return json.dumps(whole, indent=1, default=str) + "\n"

    def write(self, folder: Path) -> list[str]:
        """Write links.csv and links.json; return the lines for the report."""
        self._record.write(folder / "links.csv")
        write_whole(folder / "links.json", self.to_json())
        return list(self.lines())

    def lines(self) -> Iterator[str]:
        """Yield the lines for the report."""
        books = [book for book in self._record.counts.values() if book.sent]
        sent = sum(book.sent for book in books)
        dropped: Counter[str] = Counter()
        for book in books:
            dropped.update(book.dropped)
        of = ", ".join(f"{reason} {_share(count, sent)}" for reason, count in dropped.most_common()) or "none"
        checked = ""
        if self._check is not None:
            tested, failed = (sum(row.ok is not None for row in self._check.rows), len(self._check.warnings))
            checked = "; self-check: " + (f"{tested} tests, {failed or 'none'} failed" if tested else "nothing to test")
        yield (
            f"emulated links: {sent} messages over {len(books)} links, dropped: {of}{checked} (links.json, links.csv)"
        )
        yield from (f"WARNING: {warning}" for warning in self.warnings)
        if self.failures:
            more = f" (and {len(self.failures) - 1} more of this kind, links.json)" if len(self.failures) > 1 else ""
            yield f"WARNING: {self.failures[0]}{more}"


def _share(part: int, whole: int) -> str:
    return f"{100.0 * part / whole:.2f} %" if whole else "0 %"
