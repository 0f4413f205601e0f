"""The reference pages that `gridpeers doc` prints, made from the code: keys, messages, the scenario file."""

from __future__ import annotations

import typing
from collections.abc import Iterable, Iterator

import msgspec

from agents.agent_config import Gains, Handling
from netem.schema.fault import Fault
from netem.schema.node_fault import NodeFault
from netem.schema.partition import Partition
from plant.plant_config import GflParameters, GfmParameters, Protection, SyncCheck
from scenarios.field_docs import FieldDoc, alias_docs, class_doc, field_docs
from scenarios.results.own import pages as own_pages
from scenarios.schema.scenario_model import Case, Event, InverterTable, PlantTable, Processes, ScenarioModel, Time
from wire import bounds, keys, messages
from wire.bounds import LIMIT
from wire.codec import KINDS
from wire.table_schema import INLINE, fields_of

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
    yield from _table(header, rows)


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
    yield from _table(("type", "meaning"), ((f"`{name}`", text) for name, text in alias_docs(bounds)))
    yield ""
    yield "## Kinds of refused messages"
    yield ""
    yield from _table(("kind", "meaning"), KINDS.items())


def _scenario() -> Iterator[str]:
    yield "# The scenario file"
    yield ""
    yield "TOML. A key that is a time, a frequency or a per-unit value ends in its unit: `_s`, `_Hz`, `_pu` (of the"
    yield "inverter's own rating or nominal voltage). What has no default must be given. Gains have the units told"
    yield "here."
    for title, cls in _SCENARIO_TABLES:
        by_name = {field.info.encode_name: field.key for field in fields_of(cls)}
        by_name |= {"own": '"mine:Name"'} if cls is Fault else {}  # what it is called in the file is up to its author
        yield ""
        yield f"## {title}"
        yield ""
        yield class_doc(cls)
        yield ""
        rows = [
            (f"`{by_name[doc.name]}`", _default(doc), doc.text)
            for doc in field_docs(cls)
            if not _is_table(cls, doc.name)
        ]
        yield from _table(("key", "default", "meaning"), rows)


def _section(title: str, cls: type[msgspec.Struct], text: str, leave_out: Iterable[str] = ()) -> Iterator[str]:
    skipped = set(leave_out)
    rows = [(f"`{doc.name}`", f"`{doc.type}`", doc.text) for doc in field_docs(cls) if doc.name not in skipped]
    yield from ("", f"## {title}", "")
    if text:
        yield from (text, "")
    if rows:
        yield from _table(("field", "type", "meaning"), rows)


def _is_table(cls: type, key: str) -> bool:
    """Return whether a field is a table of its own, which has a section of its own."""
    if cls in (Fault, NodeFault):  # their models are written on one line; docs/netem.md has them
        return False
    field = next(field for field in fields_of(cls) if field.info.encode_name == key)
    if INLINE in field.marks:
        return True
    inner = [field.type, *typing.get_args(field.type)]
    return cls is not Case and any(isinstance(part, type) and issubclass(part, msgspec.Struct) for part in inner)


def _default(doc: FieldDoc) -> str:
    if not doc.default:
        return "required"
    if doc.default.startswith(("Gains(", "Handling(")):
        return f"`[{doc.name}]`"
    if doc.default == "None":
        return "none"
    shown = doc.default.replace("'", '"').replace("()", "[]")
    return f"`{ {'True': 'true', 'False': 'false'}.get(shown, shown) }`"


def _table(header: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> Iterator[str]:
    yield f"| {' | '.join(header)} |"
    yield f"|{'---|' * len(header)}"
    for row in rows:
        yield f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |"
