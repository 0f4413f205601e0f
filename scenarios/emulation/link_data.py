"""Data of emulated links that processes exchange: their configuration, reports for the record, and their status."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import msgspec

from gridpeers.netem.fault_schedule import Change, Heal
from gridpeers.netem.ledger import LinkCounts, LinkTrace
from gridpeers.netem.schema.fault import LONGEST_RUN, Fault
from gridpeers.netem.schema.netem import Netem
from gridpeers.netem.schema.pattern import Link, objections
from gridpeers.wire.codec import decode_foreign
from gridpeers.wire.messages import LinkReport, Name, Text
from gridpeers.wire.plugins.plugin import Plugin
from gridpeers.wire.schema.table_schema import Plausible, Problem
from gridpeers.wire.wording import counted, printable


class EmulationConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    netem: Netem
    """All entries; a partition by island is resolved already."""
    microgrids: dict[str, str]
    """Microgrid of every inverter, spare ones too, in the order of their table."""
    real_nodes: bool = False
    """Processes are really killed and paused, as in real time; else that is emulated."""
    keep_trace: bool = True
    """Every verdict is reported, not only their counts and their hash."""

    def to_tree(self) -> dict[str, Any]:
        tree: dict[str, Any] = msgspec.json.decode(msgspec.json.encode(self))
        return tree

    @classmethod
    def of_tree(cls, tree: Mapping[str, Any]) -> EmulationConfig:
        return msgspec.convert(tree, type=cls)


class LinkReportData(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    traces: tuple[LinkTrace, ...] = ()
    counts: dict[Name, LinkCounts] = {}
    sha256: str = ""
    """Hash (hex) of all verdicts so far."""
    failures: tuple[Text, ...] = ()
    """Sentences on plugged-in faults that have failed since the last report."""


class LinkStatus(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    holds: tuple[Text, ...] = ()
    counts: LinkCounts | None = None
    """Counts of its messages so far; None if none was judged."""


NO_MESSAGES = LinkCounts(sent=0, duplicated=0, delivered=0, dropped={}, corrupted=0, in_flight=0)

_statuses = msgspec.msgpack.Decoder(dict[Name, LinkStatus])


def decode_statuses(data: bytes) -> dict[str, LinkStatus]:
    return decode_foreign(_statuses.decode, data)


_reports = msgspec.msgpack.Decoder(LinkReportData)


def data_of(report: LinkReport) -> LinkReportData:
    """Return the data of a report; msgspec.DecodeError if they are not its sender's links."""
    data = decode_foreign(_reports.decode, report.data)
    strangers = {trace.dst for trace in data.traces} - {report.sender}
    if strangers:
        raise msgspec.ValidationError(f"{report.sender} reports of links to {', '.join(sorted(strangers))}")
    return data


AT_ONCE = 100  # Verdicts in one report: a process keeps the memory that it once needed for the largest one


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
    return tuple(map(msgspec.msgpack.encode, [*(LinkReportData(traces=batch) for batch in first), final]))


def words(kind: str, model: Any) -> str:
    """Return a fault in words: its model and its keys as in a scenario, but for defaults; one number alone as it is."""
    if isinstance(model, Plugin):
        name, keys = None, list(model.parameters)
    else:
        fields = ((it, getattr(model, it.name)) for it in msgspec.structs.fields(model))
        keys = [(it.name, value) for it, value in fields if value != it.default]
        name = model.__struct_config__.tag
    if len(keys) == 1 and keys[0][0] in ("p", "delay_s", "bytes_per_s"):
        return f"{kind} {_shown(keys[0][1])}"
    listed = ", ".join(f"{key} {_shown(value)}" for key, value in keys)
    return " ".join(filter(None, [kind, name, listed and f"({listed})"]))


def _shown(value: Any) -> str:
    if isinstance(value, bool | tuple):
        return "..." if isinstance(value, tuple) else str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)


EVERYTHING = "{*, plant} <-> {*, plant}"  # Pattern of all links there are


class LinkCommand(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """Either a fault or its end; the time from which it holds is sent beside it."""

    fault: Fault | None = None
    heal: Heal | None = None
    for_s: float | None = None
    """Duration of the fault (s of run time); without it, it holds until it is healed."""

    def __post_init__(self) -> None:
        if (self.fault is None) == (self.heal is None):
            raise ValueError("it is either a fault or a heal")

    @property
    def _change(self) -> Change:
        change = self.fault or self.heal
        assert change is not None
        return change

    @property
    def on(self) -> str:
        return self._change.on

    def at(self, t: float) -> Change:
        to_s = None if self.for_s is None else round(t + self.for_s, 9)
        times = {"from_s": t, "to_s": to_s} if self.fault else {"from_s": t}
        return msgspec.structs.replace(self._change, **times)

    def problems(self, microgrids: Mapping[str, str]) -> list[Problem]:
        links = [Problem("on", text) for text in objections(self.on, tuple(microgrids), microgrids)]
        return links + self.wrong_values()

    def wrong_values(self) -> list[Problem]:
        problems: list[Problem] = []
        if self.fault is not None:
            problems += msgspec.structs.replace(self.fault, from_s=0.0, to_s=None).problems()
        if self.for_s is not None:
            allowed = Plausible("a time of the run", 0.0, LONGEST_RUN, above_zero=True)
            if text := allowed.objection(self.for_s, "s"):
                problems.append(Problem("for", text))
        return problems

    def __str__(self) -> str:
        where = "all links" if self.on == EVERYTHING else self.on
        if self.fault is None:
            return f"{where}: heal"
        faults = [words(kind, model) for kind, model in self.fault.models().items()]
        return f"{where}: " + ", ".join(faults + ([] if self.for_s is None else [f"for {self.for_s:g} s"]))

    def in_words(self, impaired: Sequence[Link]) -> str:
        if self.fault is not None:
            return str(self)
        where = "all links" if self.on == EVERYTHING else self.on
        return f"{where}: {counted(len(impaired), 'link')} healed" if impaired else f"{where}: no link has a fault"

    def to_tree(self) -> dict[str, Any]:
        tree: dict[str, Any] = msgspec.to_builtins(self)
        return tree

    @classmethod
    def of_tree(cls, tree: Mapping[str, Any]) -> LinkCommand:
        """Return the command in a message; raise ValueError if it is none."""
        try:
            command = msgspec.convert(tree, type=cls)
        except msgspec.ValidationError as error:
            raise ValueError(f"no command to links: {printable(str(error), 200)}") from None
        if command.fault is not None and command.fault.own:  # else anybody who reaches the run could import any module
            raise ValueError("no command to links: a fault of your own is written in the scenario before the run")
        return command
