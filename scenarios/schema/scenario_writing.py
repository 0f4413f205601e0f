"""A scenario as TOML with every key spelled out: what a run leaves in its folder."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from itertools import chain
from typing import Any

import msgspec

from gridpeers.scenarios.schema.scenario_model import AS_RUN, ScenarioModel
from gridpeers.wire.schema.table_schema import INHERITED, INLINE, NO_KEY, NamedTables, OtherKeys, fields_of


def to_toml(
    scenario: ScenarioModel, as_run: Mapping[str, Any], remarks: Iterable[str] = (), *, terse: bool = False
) -> str:
    """Return every key of a scenario, defaults included, and the table `[as_run]`; if `terse`, what is no default.

    Defaults are written out because they may differ in a later version. The remarks become comments at the head.
    """
    keys, tables = _lines(scenario, "", scenario, terse=terse)
    if terse:
        head, foot = [f"# {remark}".rstrip() for remark in remarks], []
    else:
        first = "# The scenario as run, every default spelled out. `gridpeers run` takes this file as it is."
        head = [first, *(f"# {remark}" for remark in remarks)]
        foot = ["", f"[{AS_RUN}]", *(f"{key} = {_value(value)}" for key, value in as_run.items())]
    lines = chain(head, keys, tables, foot)
    return "".join(f"{line}\n" for line in lines)


def _lines(
    struct: msgspec.Struct, path: str, common: ScenarioModel, *, entry: bool = False, terse: bool = False
) -> tuple[list[str], Iterator[str]]:
    """Return the keys of a table, and the tables below it; no case repeats a common table.

    Tables below an entry of a list are written on its lines.
    """
    keys: list[str] = []
    tables: list[Iterator[str]] = []
    for field in fields_of(type(struct)):
        value = getattr(struct, field.name)
        if value is None or NO_KEY in field.marks:
            continue
        omits = terse or struct.__struct_config__.omit_defaults
        default = omits and not field.required and INHERITED not in field.marks and value == field.default
        common_too = INHERITED in field.marks and value == getattr(common, field.name)
        if default or common_too:
            continue
        where = f"{path}.{_key(field.key)}" if path else _key(field.key)
        below_terse = terse and INHERITED not in field.marks  # left out, it would be the common table's
        if others := field.mark(OtherKeys):
            keys += [f"{_key(key)} = {inline(given)}" for key, given in map(others.write, value)]
        elif INLINE in field.marks:
            inner, below = _lines(value, path, common, terse=below_terse)
            keys += inner
            tables.append(below)
        elif isinstance(value, msgspec.Struct) and not entry:
            tables.append(_table(f"[{where}]", value, where, common, terse=below_terse))
        elif isinstance(value, tuple) and value and isinstance(value[0], msgspec.Struct):
            tables.append(_entries(value, where, common, terse=terse))
        elif isinstance(value, dict) and not entry and any(isinstance(it, msgspec.Struct) for it in value.values()):
            for name, item in value.items():
                key = f"{path if field.mark(NamedTables) else where}.{_key(name)}"
                tables.append(_table(f"[{key}]", item, key, common, terse=terse))
        elif value or not isinstance(value, tuple | dict):
            keys.append(f"{field.key} = {inline(msgspec.to_builtins(value))}")
    return keys, chain.from_iterable(tables)


def _table(header: str, struct: msgspec.Struct, path: str, common: ScenarioModel, *, terse: bool) -> Iterator[str]:
    keys, tables = _lines(struct, path, common, terse=terse)
    return chain(["", header, *keys], tables)


def _entries(structs: Iterable[msgspec.Struct], path: str, common: ScenarioModel, *, terse: bool) -> Iterator[str]:
    for struct in structs:
        yield ""
        yield f"[[{path}]]"
        yield from _lines(struct, path, common, entry=True, terse=terse)[0]


def _key(name: str) -> str:
    bare = name.replace("_", "").replace("-", "")
    return name if bare.isascii() and bare.isalnum() else _value(name)


def inline(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(key)} = {inline(below)}" for key, below in value.items()) + " }"
    if isinstance(value, tuple | list):
        return "[" + ", ".join(map(inline, value)) + "]"
    return _value(value)


def _value(value: Any) -> str:
    """Write one value; JSON's strings, numbers, lists and booleans are TOML's too, but for one character."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
