"""The reference pages that `gridpeers doc` prints, made from the code: keys, messages, the scenario file."""

from __future__ import annotations

import typing
from collections.abc import Iterable, Iterator
from typing import Any

import msgspec

from agents.agent_config import Gains, Handling
from netem.schema.fault import Fault
from netem.schema.node_fault import NodeFault
from netem.schema.partition import Partition
from plant.plant_config import GflParameters, GfmParameters, Protection, SyncCheck
from scenarios.field_docs import alias_docs, class_doc, field_docs, field_table, markdown_table
from scenarios.results.own import pages as own_pages
from scenarios.schema.scenario_model import Case, Event, InverterTable, PlantTable, Processes, ScenarioModel, Time
from wire import bounds, keys, messages
from wire.bounds import LIMIT
from wire.codec import KINDS
from wire.table_schema import fields_of

TOPICS = ("keys", "messages", "scenario", *own_pages.PAGES)
"""Pages there are."""

_SCENARIO_TABLES: tuple[tuple[str, type[msgspec.Struct]], ...] = (
    ("Top of the file", ScenarioModel),
    ("[time]", Time),
    ("[plant]", PlantTable),
    ("[plant.inverter.NAME]", InverterTable),
    ("[plant.gfm]", GfmParameters),
    ("[plant.gfl]", GflParameters),
    ("[plant.sync_check]", SyncCheck),
    ("[protection]", Protection),
    ("[gains]", Gains),
    ("[handling]", Handling),
    ("[processes]", Processes),
    ("[[event]]", Event),
    ("[case.NAME]", Case),
    ("[[link]], [[case.NAME.link]]", Fault),
    ("[[partition]], [[case.NAME.partition]]", Partition),
    ("[[node]], [[case.NAME.node]]", NodeFault),
)


def page(topic: str) -> str:
    """Return markdown of one page.

    Parameters
    ----------
    topic : str
        One of `TOPICS`.
    """
    if topic in own_pages.PAGES:
        return "\n".join(own_pages.page(topic)) + "\n"
    makers = {"keys": _keys, "messages": _messages, "scenario": _scenario}
    return "\n".join(makers[topic]()) + "\n"


def _keys() -> Iterator[str]:
    yield "# Keys of a run"
    yield ""
    header = ("key", "kind", "message", "from", "to", "when")
    rows = ((f"`{s.expression}`", s.kind, s.message, s.sender, s.listener, s.when) for s in keys.describe())
    yield from markdown_table(header, rows)


def _messages() -> Iterator[str]:
    yield "# Messages"
    yield ""
    yield f"msgpack maps with a field `type` that names the message, and their CRC-32; SI units; at most {LIMIT} bytes."
    yield "Another CRC-32, unknown fields, missing fields, wrong types and values out of bounds are refused:"
    yield "counted by kind, logged once and dropped."
    common = {doc.name for doc in field_docs(messages.Message)}
    yield from _section("Fields of every message", messages.Message, "")
    for kind in (*typing.get_args(messages.AnyMessage), messages.PlantEvent):
        yield from _section(
            kind.__name__, kind, class_doc(kind), leave_out=common if kind != messages.PlantEvent else set()
        )
    yield ""
    yield "## Types, and their bounds"
    yield ""
    yield from markdown_table(("type", "meaning"), ((f"`{name}`", text) for name, text in alias_docs(bounds)))
    yield ""
    yield "## Kinds of refused messages"
    yield ""
    yield from markdown_table(("kind", "meaning"), KINDS.items())


def _scenario() -> Iterator[str]:
    yield "# The scenario file"
    yield ""
    yield "TOML. A key that is a time, a frequency or a per-unit value ends in its unit: `_s`, `_Hz`, `_pu` (of the"
    yield "inverter's own rating or nominal voltage). What has no default must be given. A value out of its range is an"
    yield "error, and so is an unknown key."
    for title, cls in _SCENARIO_TABLES:
        yield from ("", f"## {title}", "", class_doc(cls), "")
        elsewhere = [field.name for field in fields_of(cls) if _has_section(field.type)] if cls is not Case else []
        yield from field_table(cls, left_out=elsewhere)


def _section(title: str, cls: type[msgspec.Struct], text: str, leave_out: Iterable[str] = ()) -> Iterator[str]:
    skipped = set(leave_out)
    rows = [(f"`{doc.name}`", f"`{doc.type}`", doc.text) for doc in field_docs(cls) if doc.name not in skipped]
    yield from ("", f"## {title}", "")
    if text:
        yield from (text, "")
    if rows:
        yield from markdown_table(("field", "type", "meaning"), rows)


def _has_section(kind: Any) -> bool:
    """Return whether a field is a table, or a list of tables, with a section of its own."""
    tables = {cls for _, cls in _SCENARIO_TABLES}
    return kind in tables or any(_has_section(part) for part in typing.get_args(kind))
