"""All verdicts of each emulated link in one."""

from __future__ import annotations

from gridpeers.netem.ledger import LinkTrace
from gridpeers.scenarios.results.link_record import LinkRecord


def by_link(record: LinkRecord) -> dict[tuple[str, str], LinkTrace]:
    """Return the verdicts of each link (src, dst)."""
    found: dict[tuple[str, str], LinkTrace] = {}
    for part in record.traces():
        link = part.src, part.dst
        one = found.get(link, LinkTrace(*link, (), (), ()))
        found[link] = LinkTrace(*link, one.seq + part.seq, one.t + part.t, one.outcome + part.outcome)
    return found
