"""Record of the emulated links of one case: counts and one hash of all verdicts, for links.json and the report."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import msgspec

from gridpeers.netem.ledger import LinkCounts, LinkTrace, combined
from gridpeers.scenarios.emulation.link_data import data_of
from gridpeers.scenarios.results.run_files import write_whole
from gridpeers.wire.messages import LinkReport


class LinkRecord:
    """Record the link reports of one case; verdicts, as many as messages, stay in memory only where `keep` says so."""

    def __init__(self, *, keep: bool = True) -> None:
        self._keep = keep
        self.traces: list[LinkTrace] = []
        """Verdicts, in parts of one link, as they were reported."""
        self.counts: dict[tuple[str, str], LinkCounts] = {}
        """Counts of the messages of each link (src, dst)."""
        self.failures: list[str] = []
        """Sentences on plugged-in faults that failed."""
        self._sha256: dict[str, str] = {}

    def __call__(self, report: LinkReport) -> None:
        try:
            data = data_of(report)
        except msgspec.DecodeError:  # not ours
            return
        if self._keep:
            self.traces += data.traces
        self.failures += data.failures
        self.counts.update({(src, report.sender): counts for src, counts in data.counts.items()})
        if data.sha256:
            self._sha256[report.sender] = data.sha256

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

    def write(self, folder: Path) -> None:
        """Write links.json; nothing if no message was sent."""
        if self.sent:
            counts = [
                {"src": src, "dst": dst, **msgspec.to_builtins(of)} for (src, dst), of in sorted(self.counts.items())
            ]
            whole: dict[str, object] = {"trace_sha256": self.sha256, "accounts": counts}
            whole |= {"failures": sorted(self.failures)} if self.failures else {}
            write_whole(folder / "links.json", json.dumps(whole, indent=1, default=str) + "\n")

    def lines(self) -> Iterator[str]:
        if not self.sent:
            return
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
