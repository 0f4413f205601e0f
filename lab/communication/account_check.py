"""Check of the message account: what was sent was heard, lost, cut off, late or is in flight, on every link."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

from gridpeers.lab.communication.communication_summary import CommunicationSummary
from gridpeers.lab.communication.link_accounts import Missing
from gridpeers.lab.communication.record_sink import Link
from gridpeers.netem.ledger import LinkCounts
from gridpeers.scenarios.checks.check_verdict import Check, NotJudgedError, Violation, require_longer
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.wire.schema.plausible import Plausible, Unit


class MessageAccount(Check):
    """Every state that was sent is accounted for at its receiver, link by link.

    Of emulated links the accounts and verdicts of their receivers count; of others in simulated time every decision
    has the neighbours' states of the tick before; in wall-clock time every number arrives, from the first one on that
    does between two processes, or once both have been there for 7 s (`LINKED_WITHIN`), unless its receiver says at that
    time that it dropped as many. A process that is silent for long, as it is frozen, begins anew: its links are given
    up.
    """

    in_flight_s: Annotated[float, Unit("s"), Plausible("the time of a message on its way", 0.0, 60.0)] = 1.0
    """Time (s) before the end of the run, or before an agent ends or is frozen, from which on a message may still be
    on its way."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        """Yield the links whose account does not close."""
        found = case.communication
        if found.unreadable:
            yield Violation(text="messages or parts of the record that cannot be read", value=found.unreadable, limit=0)
        for link, counts in sorted(found.counts.items()):
            yield from _closes(link, counts)
            text = f"states of {link[0]} without a verdict of the emulated link"
            yield from _missing(link, found.unjudged.get(link, Missing()), text)
        links = self._without_account(found)
        for agent in found.agents:
            for link, missing in links.items():
                if link[1] == agent:
                    yield from _missing(link, missing, f"states of {link[0]} neither heard nor lost")
        if not (found.counts or links):
            raise NotJudgedError("no agent listens to another" if found.has_arrivals else _NO_ARRIVALS)
        if links and not (found.counts or found.simulated):
            require_longer(found.t_end, "in_flight_s", self.in_flight_s)

    def _without_account(self, found: CommunicationSummary) -> dict[Link, Missing]:
        """Return what is missing on each link whose receiver keeps no account of it."""
        if found.simulated:
            return {link: missing for link, missing in found.unheard.items() if link not in found.counts}
        if not found.has_arrivals:
            return {}
        return {link: self._not_arrived(found, link) for link in sorted(found.arrivals)}

    def _not_arrived(self, found: CommunicationSummary, link: Link) -> Missing:
        missing = Missing()
        for account in found.arrivals[link]:
            until = min(account.until, found.t_end) - self.in_flight_s
            for t in (*[account.early.first] * account.early.count, *account.late.values()):
                if t <= until:
                    missing.add(t)
        return missing


_NO_ARRIVALS = 'in wall-clock time a record = "decisions" does not have what arrived'


def _missing(link: Link, missing: Missing, text: str) -> Iterator[Violation]:
    if missing.count:
        yield Violation(text=text, t=missing.first, agent=link[1], value=missing.count, limit=0)


def _closes(link: Link, counts: LinkCounts) -> Iterator[Violation]:
    """Yield the difference of an account: sent + duplicated = delivered + dropped + in flight."""
    src, dst = link
    found = counts.delivered + sum(counts.dropped.values()) + counts.in_flight
    if not counts.closes:
        text = f"messages of {src} delivered, dropped or in flight, of {counts.sent + counts.duplicated} sent"
        yield Violation(text=text, agent=dst, value=found, limit=counts.sent + counts.duplicated)
