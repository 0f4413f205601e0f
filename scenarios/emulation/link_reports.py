"""What the links into one receiver did, as it travels to the record."""

from __future__ import annotations

import msgspec

from netem.ledger import LinkCounts, LinkTrace
from wire.bounds import Name, Text
from wire.messages import LinkReport


class LinkBook(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A part of a receiver's book."""

    traces: tuple[LinkTrace, ...] = ()
    """Verdicts since the last part."""
    counts: dict[Name, LinkCounts] = {}
    """Of each sender how its messages have fared so far."""
    sha256: str = ""
    """Hash (hex) of all verdicts so far."""
    failures: tuple[Text, ...] = ()
    """Sentences on faults of somebody's own that failed since the last part."""


class LinkStatus(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How a link stands while the run goes on."""

    holds: tuple[str, ...] = ()
    """What it does now, each fault in words."""
    counts: LinkCounts | None = None
    """How its messages have fared so far; None if none was judged."""


encode_statuses = msgspec.msgpack.Encoder().encode
"""Bytes of the stands of a receiver's links, by sender."""

decode_statuses = msgspec.msgpack.Decoder(dict[str, LinkStatus]).decode
"""Stands of the bytes; msgspec.DecodeError if there are none."""

encode_book = msgspec.msgpack.Encoder().encode
"""Bytes of a book."""

_decode_book = msgspec.msgpack.Decoder(LinkBook).decode


def book_of(report: LinkReport) -> LinkBook:
    """The part of a receiver's book that is in a report; msgspec.DecodeError if it is none, or another's."""
    book = _decode_book(report.data)
    strangers = {trace.dst for trace in book.traces} - {report.sender}
    if strangers:
        raise msgspec.ValidationError(f"{report.sender} reports of links to {', '.join(sorted(strangers))}")
    return book


AT_ONCE = 1000
"""Verdicts in one part: some 25 bytes each, so that a part is far below what a message may have."""


def parts(
    traces: tuple[LinkTrace, ...], counts: dict[str, LinkCounts], sha256: str, failures: tuple[str, ...] = ()
) -> tuple[bytes, ...]:
    """Cut a book into parts, none of them too long; the counts, the hash and what failed stand in the last one."""
    pieces = [
        LinkTrace(
            trace.src, trace.dst, trace.seq[i : i + AT_ONCE], trace.t[i : i + AT_ONCE], trace.outcome[i : i + AT_ONCE]
        )
        for trace in traces
        for i in range(0, len(trace.seq), AT_ONCE)
    ]
    batches: list[list[LinkTrace]] = [[]]
    for piece in pieces:
        if sum(len(other.seq) for other in batches[-1]) + len(piece.seq) > AT_ONCE:
            batches.append([])
        batches[-1].append(piece)
    *first, last = (tuple(batch) for batch in batches)
    books = [LinkBook(traces=batch) for batch in first]
    return tuple(map(encode_book, [*books, LinkBook(traces=last, counts=counts, sha256=sha256, failures=failures)]))
