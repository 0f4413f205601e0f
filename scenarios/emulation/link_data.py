"""What travels of emulated links: the configuration that processes start with, reports for the record, their status."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import msgspec

from gridpeers.netem.ledger import LinkCounts, LinkTrace
from gridpeers.netem.schema.netem import Netem
from gridpeers.wire.bounds import Name, Text
from gridpeers.wire.codec import decode_foreign
from gridpeers.wire.messages import LinkReport


class EmulationConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The run's faults, and the microgrids that their patterns name."""

    netem: Netem
    """All entries; a partition by island is resolved already."""
    microgrids: dict[str, str]
    """Microgrid of every inverter, spare ones too, in the order of their table."""
    real_nodes: bool = False
    """Whether processes are really killed and paused, as in wall-clock time; else that is emulated."""
    keep_trace: bool = True
    """Whether every verdict is reported, not only their counts and their hash."""

    def to_tree(self) -> dict[str, Any]:
        """Return it as the tree `links` of `AgentConfig` and `PlantConfig`, whose packages know no netem."""
        tree: dict[str, Any] = msgspec.json.decode(msgspec.json.encode(self))
        return tree

    @classmethod
    def of_tree(cls, tree: Mapping[str, Any]) -> EmulationConfig:
        """Return the configuration in a tree; raise msgspec.ValidationError if the tree is none."""
        return msgspec.convert(tree, type=cls)


class LinkReportData(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The data of one `LinkReport`."""

    traces: tuple[LinkTrace, ...] = ()
    """Verdicts since the last report."""
    counts: dict[Name, LinkCounts] = {}
    """Counts of the messages of each sender so far."""
    sha256: str = ""
    """Hash (hex) of all verdicts so far."""
    failures: tuple[Text, ...] = ()
    """Sentences on plugged-in faults that have failed since the last report."""


class LinkStatus(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The status of a link while the run goes on."""

    holds: tuple[Text, ...] = ()
    """The faults that it has now, each in words."""
    counts: LinkCounts | None = None
    """Counts of its messages so far; None if none was judged."""


encode_statuses = msgspec.msgpack.Encoder().encode
"""Encode the `LinkStatus` of a receiver's links, by sender."""

_statuses = msgspec.msgpack.Decoder(dict[Name, LinkStatus])


def decode_statuses(data: bytes) -> dict[str, LinkStatus]:
    """Decode them; raise msgspec.DecodeError if the bytes are something else."""
    return decode_foreign(_statuses.decode, data)


encode_data = msgspec.msgpack.Encoder().encode
"""Encode a `LinkReportData`."""

_reports = msgspec.msgpack.Decoder(LinkReportData)


def data_of(report: LinkReport) -> LinkReportData:
    """Return the data of a report; raise msgspec.DecodeError if they are not its sender's links."""
    data = decode_foreign(_reports.decode, report.data)
    strangers = {trace.dst for trace in data.traces} - {report.sender}
    if strangers:
        raise msgspec.ValidationError(f"{report.sender} reports of links to {', '.join(sorted(strangers))}")
    return data


AT_ONCE = 100
"""Verdicts in one report. Decoded, each has some 350 bytes, and a process of hours keeps the memory that it once needed
for the largest report."""


def report_data(
    traces: tuple[LinkTrace, ...], counts: dict[str, LinkCounts], sha256: str, failures: tuple[str, ...] = ()
) -> tuple[bytes, ...]:
    """Return the encoded data of as many reports as are needed; the last one has the counts, hash and failures."""
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
    final = LinkReportData(traces=last, counts=counts, sha256=sha256, failures=failures)
    return tuple(map(encode_data, [*(LinkReportData(traces=batch) for batch in first), final]))
