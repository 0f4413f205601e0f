"""The reference pages that `gridpeers doc` prints, made from the code: keys, messages, scenario file, plugins."""

from __future__ import annotations

import ast
import inspect
import textwrap
import typing
from collections.abc import Iterable, Iterator
from itertools import pairwise
from types import ModuleType
from typing import Any

import msgspec

from gridpeers.agents import graphs
from gridpeers.agents.carriers.law_registry import LAWS
from gridpeers.netem.models import own_fault
from gridpeers.plant.inverters.inverter_registry import INVERTERS
from gridpeers.plant.tables.feeder_columns import TABLES, LoadColumns, Manifest
from gridpeers.scenarios.checks import check_registry
from gridpeers.scenarios.results import claims, metric
from gridpeers.scenarios.schema.scenario_model import Case, ScenarioModel
from gridpeers.wire import keys, messages
from gridpeers.wire.codec import KINDS
from gridpeers.wire.plugins.registry import PluginError, Registry
from gridpeers.wire.schema.table_reading import in_words, kinds_of, shown, table_of, tables_in
from gridpeers.wire.schema.table_schema import INLINE, NO_KEY, Field, NamedTables, OtherKeys, fields_of, shared_fields


def field_docs(cls: type) -> dict[str, tuple[str, str]]:
    """Return annotation (as in the source) and docstring of each field of a class, those of its base classes first."""
    written: dict[str, tuple[str, str]] = {}
    for base in reversed(cls.__mro__):
        if base not in (object, msgspec.Struct):
            written |= _written_in(base)
    names = cls.__struct_fields__ if issubclass(cls, msgspec.Struct) else tuple(written)
    return {name: written[name] for name in names}


def field_table(cls: type, *, left_out: Iterable[str] = ()) -> Iterator[str]:
    skipped, docs = set(left_out), field_docs(cls)
    rows = []
    for field in fields_of(cls):
        if not (field.name in skipped or INLINE in field.marks or NO_KEY in field.marks or field.mark(NamedTables)):
            text = field.help or docs.get(field.name, ("", ""))[1]
            key = '"mine:Name"' if field.mark(OtherKeys) else field.key
            rows.append((f"`{key}`", _type(field), field.unit, field.span, _default(field), text))
    if rows:
        yield from markdown_table(("key", "type", "unit", "range", "default", "meaning"), rows)


def markdown_table(header: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> Iterator[str]:
    yield f"| {' | '.join(header)} |"
    yield f"|{'---|' * len(header)}"
    for row in rows:
        yield f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |"


def alias_docs(module: ModuleType) -> tuple[tuple[str, str], ...]:
    """Return names and docstrings of the annotated types that a module defines for its fields."""
    body = ast.parse(inspect.getsource(module)).body
    return tuple(
        (ast.unparse(statement.targets[0]), _one_line(after.value.value))
        for statement, after in pairwise(body)
        if isinstance(statement, ast.Assign) and ast.unparse(statement.value).startswith("Annotated[")
        if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
    )


def _written_in(cls: type) -> dict[str, tuple[str, str]]:
    try:
        definition = ast.parse(textwrap.dedent(inspect.getsource(cls))).body[0]
    except (OSError, TypeError):  # of a class that was made, or written in a notebook
        return {}
    assert isinstance(definition, ast.ClassDef)
    found: dict[str, tuple[str, str]] = {}
    for statement, after in zip(definition.body, [*definition.body[1:], None], strict=True):
        if isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name):
            text = after.value.value if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant) else ""
            found[statement.target.id] = ast.unparse(statement.annotation), _one_line(text)
    return found


def _one_line(text: object) -> str:
    return " ".join(str(text or "").split())


def _type(field: Field) -> str:
    kinds = (
        dict if isinstance(kind, type) and issubclass(kind, msgspec.Struct) else kind for kind in kinds_of(field.type)
    )
    return in_words(*kinds).removeprefix("a ").replace(" in quotes", "")


def _default(field: Field) -> str:
    if field.required:
        return "required"
    value: Any = field.default
    if isinstance(value, msgspec.Struct):
        return f"`[{field.key}]`"
    return "none" if value is None else f"`{shown(value)}`"


_LAW = "A class derived from gridpeers.Law; `docs/how-to/plug-ins.md` has the contract and examples."
_INVERTER = "A class derived from gridpeers.InverterModel; `docs/how-to/plug-ins.md` has the contract and an example."

_REGISTRIES: dict[str, tuple[Registry[Any], str, str]] = {
    "laws": (LAWS, _LAW, 'law = "mine:Mine", or law = { use = "mine:Mine", gain = 2.0 }, for all cases or in one'),
    "inverters": (INVERTERS, _INVERTER, 'model = "mine:Mine" in [plant.gfm], [plant.gfl] or [plant.inverter.NAME]'),
    "metrics": (
        metric.METRICS,
        metric.__doc__ or "",
        'metrics = ["mine:nadir_Hz", { use = "mine:Within", band_Hz = 0.05 }]',
    ),
    "claims": (claims.CLAIMS, claims.__doc__ or "", 'claims = ["mine:restored"]'),
    "checks": (
        check_registry.CHECKS,
        check_registry.__doc__ or "",
        'checks = ["mine:Calm", { use = "frequency", within_s = 1.0 }, { use = "rating", off = true }]',
    ),
    "faults": (own_fault.FAULTS, own_fault.__doc__ or "", '"mine:Jammer" = { share = 0.2 } in an entry [[link]]'),
    "graphs": (graphs.GRAPHS, graphs.__doc__ or "", 'graph = "mine:star", or graph = { use = "mine:Nearest", k = 3 }'),
}
"""By topic: the registry, how an entry is written, and how a scenario names one."""

TOPICS = ("keys", "messages", "scenario", "feeder", *_REGISTRIES)


def page(topic: str) -> str:
    makers = {"keys": _keys, "messages": _messages, "scenario": _scenario, "feeder": _feeder}
    lines = makers[topic]() if topic in makers else _registry(topic)
    return "\n".join(lines) + "\n"


def _keys() -> Iterator[str]:
    yield from ("# Keys of a run", "")
    yield from ("Operators and viewers are command lines, pages of a run and recorders.", "")
    header = ("key", "kind", "message", "from", "to", "when")
    rows = (
        (f"`{s.expression}`", s.kind, s.message, ", ".join(s.writers), ", ".join(s.readers), s.when)
        for s in keys.KEY_SPECS
    )
    yield from markdown_table(header, rows)


def _messages() -> Iterator[str]:
    yield from (
        "# Messages",
        "",
        "msgpack maps with a field `type` that names the message, and their CRC-32; SI units; "
        f"at most {messages.LONGEST_MESSAGE} bytes.",
        "Another CRC-32, unknown fields, missing fields, wrong types and values out of bounds are refused:",
        "counted by kind, logged once and dropped.",
    )
    common = set(field_docs(messages.Message))
    yield from _section("Fields of every message", messages.Message, "")
    for kind in (*typing.get_args(messages.AnyMessage), messages.PlantEvent):
        yield from _section(
            kind.__name__,
            kind,
            _one_line(inspect.getdoc(kind)),
            leave_out=common if kind != messages.PlantEvent else set(),
        )
    yield from ("", "## Types, and their bounds", "")
    yield from markdown_table(("type", "meaning"), ((f"`{name}`", text) for name, text in alias_docs(messages)))
    yield from ("", "## Kinds of refused messages", "")
    yield from markdown_table(("kind", "meaning"), KINDS.items())


def _scenario() -> Iterator[str]:
    yield from ("# The scenario file", "")
    yield "TOML. Times, frequencies and per-unit values end in their unit: `_s`, `_Hz`, `_pu` (of the inverter's own"
    yield "rating or nominal voltage). Parameters of laws have no suffix. A key without a default is required. An"
    yield "unknown key, or a value out of its range, is an error."
    titles: dict[type, list[str]] = {ScenarioModel: ["Top of the file"]}
    for title, cls in tables_in(ScenarioModel):
        titles.setdefault(cls, []).append(title)
    for cls, places in titles.items():
        yield from ("", f"## {', '.join(places)}", "", _one_line(inspect.getdoc(cls)), "")
        tables = [field.name for field in fields_of(cls) if table_of(field.type) and not field.mark(OtherKeys)]
        elsewhere = [] if cls is Case else tables
        yield from field_table(cls, left_out=elsewhere)


def _feeder() -> Iterator[str]:
    yield from ("# A feeder", "")
    yield "A folder of CSV tables with one header line, UTF-8. A quantity's unit is in its column's name. Further"
    yield "columns are free. `plant/data/README.md` says which files a feeder needs."
    tables: list[type[msgspec.Struct]] = [*TABLES.values(), LoadColumns, Manifest]
    for cls in tables:
        file, _, text = _one_line(inspect.getdoc(cls)).removesuffix(".").partition(": ")
        yield from ("", f"## {file}", "")
        if text:
            yield from (f"{text[0].upper()}{text[1:]}.", "")
        yield from field_table(cls)


def _section(title: str, cls: type[msgspec.Struct], text: str, leave_out: Iterable[str] = ()) -> Iterator[str]:
    skipped = set(leave_out)
    rows = [(f"`{name}`", f"`{kind}`", text) for name, (kind, text) in field_docs(cls).items() if name not in skipped]
    yield from ("", f"## {title}", "")
    if text:
        yield from (text, "")
    if rows:
        yield from markdown_table(("field", "type", "meaning"), rows)


def _registry(topic: str) -> Iterator[str]:
    registry, how, key = _REGISTRIES[topic]
    yield from (f"# {registry.plural[:1].upper()}{registry.plural[1:]}", "", how.strip(), "")
    yield f"In a scenario: {key}. A module is looked for beside the scenario's file, then on the Python path. A"
    yield f"distribution adds its own under the entry points `{registry.group}`."
    if not registry.names:
        yield from ("", "None come with gridpeers.")
    for name in registry.names:
        yield from ("", f"## {name}", "")
        yield from _entry(registry, name)


def _entry(registry: Registry[Any], name: str) -> Iterator[str]:
    try:
        it = registry.resolve(name)
    except PluginError as error:  # an entry point of somebody's that is broken
        yield f"Cannot be used: {error}"
        return
    yield (inspect.getdoc(it) or "").partition("\n\n")[0].replace("\n", " ") or "Its author tells nothing of it."
    if not isinstance(it, type):
        return
    if lines := list(field_table(it)):
        yield from ("", *lines)
    if shared := shared_fields(it):
        rows = ((f"`{of.name}`", of.unit, of.span, of.help) for of in shared)
        yield from ("", *markdown_table(("shares", "unit", "range", "meaning"), rows))
