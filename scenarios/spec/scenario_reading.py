"""From TOML tables to the types of `model`, noting every mistake and going on."""

from __future__ import annotations

import math
import types
import typing
from collections.abc import Mapping
from typing import Any, TypeVar

import msgspec

from agents.agent_config import Secondary
from netem.netem_errors import shown
from netem.plausible_links import number_in, objection
from netem.spec.netem import Netem
from netem.spec.netem_reading import ENTRIES, read_netem
from scenarios.spec.ranges import range_of
from scenarios.spec.scenario_errors import Mistakes
from scenarios.spec.scenario_model import Case, Scenario, key_of
from wire.suggestion import suggestion

AS_RUN = "as_run"
"""Table that a run adds to its copy of the scenario; it is read over, so that the copy can be run again."""

FOR_EVERY_CASE = ("gains", "handling")
"""Tables that hold for every case, and that a case may have as its own, starting from the common one."""

T = TypeVar("T", bound=msgspec.Struct)

_UNIT_WORDS = {"s": "in seconds", "pu": "per unit", "Hz": "in hertz"}
_KNOWN_UNITS = ("us", "ms", "s", "pu", "percent", "kW", "W", "kvar", "kV", "V", "mHz", "Hz")


def read_tables(data: Mapping[str, Any], mistakes: Mistakes) -> Scenario:
    """Build a scenario from parsed TOML.

    A key with a mistake takes its default, so that the checks that follow find the other mistakes; the result is of
    use only when `mistakes` stays empty.
    """
    return read_struct(Scenario, {key: value for key, value in data.items() if key != AS_RUN}, mistakes)


def read_struct(cls: type[T], data: Mapping[str, Any], mistakes: Mistakes) -> T:
    """Build any file's top table in the same manner; a `dict[str, Any]` in it is left as it is written."""
    read = _struct(cls, data, "", mistakes, {})
    assert isinstance(read, cls)
    return read


def _struct(cls: type, data: Any, path: str, mistakes: Mistakes, bases: Mapping[str, Any]) -> Any:
    """One table; `bases` holds, by key, what a table below starts from instead of the defaults of its type."""
    fields = {key_of(cls, field): field for field in msgspec.structs.fields(cls) if field.type is not Netem}
    if not isinstance(data, Mapping):
        mistakes.add(path, f"must be a table with the keys {', '.join(fields)}, got {shown(data)}")
        data = {}
    base = bases.get(path.rpartition(".")[2])
    base = base if isinstance(base, cls) else None  # not for a case that is named like the table
    values: dict[str, Any] = {}
    entries = ENTRIES if cls in (Scenario, Case) else {}
    if entries:
        values["netem"], wrong = read_netem({key: data[key] for key in entries if key in data}, seed=0)
        for mistake in wrong:
            mistakes.add(_join(path, mistake.path), mistake.text)
    for key in data:
        if key not in fields and key not in entries:
            mistakes.add(_join(path, key), _unknown_key(key, cls, [*fields, *entries]))
    for key, field in fields.items():
        below = _join(path, key)
        if cls is Scenario and field.name == "cases":
            bases = {name: values[name] for name in FOR_EVERY_CASE}
        if key in data:
            values[field.name] = _value(field, data[key], below, cls, mistakes, bases)
        elif base is not None:
            values[field.name] = getattr(base, field.name)
        elif key in bases:
            values[field.name] = bases[key]
        elif field.default is not msgspec.NODEFAULT:
            values[field.name] = field.default
        elif field.default_factory is not msgspec.NODEFAULT:
            values[field.name] = field.default_factory()
        else:
            mistakes.add(below, f"is missing; {_expected(field)}")
            values[field.name] = _placeholder(field.type)
    return cls(**values)


def _value(
    field: msgspec.structs.FieldInfo, raw: Any, path: str, cls: type, mistakes: Mistakes, bases: Mapping[str, Any]
) -> Any:
    """One key's value, checked; its default when it is wrong."""
    kind = field.type
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        return _struct(kind, raw, path, mistakes, bases)
    inner = typing.get_args(kind)
    if typing.get_origin(kind) is tuple and isinstance(inner[0], type) and issubclass(inner[0], msgspec.Struct):
        if isinstance(raw, list):
            return tuple(_struct(inner[0], item, f"{path}[{i}]", mistakes, bases) for i, item in enumerate(raw))
        mistakes.add(path, f"must be written as [[{path}]], got {shown(raw)}")
        return ()
    if typing.get_origin(kind) is dict and isinstance(inner[1], type) and issubclass(inner[1], msgspec.Struct):
        if isinstance(raw, Mapping) and all(isinstance(item, Mapping) for item in raw.values()):
            return {name: _struct(inner[1], item, f"{path}.{name}", mistakes, bases) for name, item in raw.items()}
        mistakes.add(path, f"must be written as tables [{path}.NAME], got {shown(raw)}")
        return {}
    if kind == float | None:  # TOML has no null: a key that is written is a number
        kind = float
    try:
        value = msgspec.convert(raw, kind)
    except msgspec.ValidationError:
        mistakes.add(path, _wrong_type(kind, raw))
        return _placeholder(kind) if field.default is msgspec.NODEFAULT else field.default
    if isinstance(value, str) and not value.isprintable():
        mistakes.add(path, f"has characters that cannot be printed: {value!a}; write letters, digits and signs")
        return field.default if isinstance(field.default, str) else _placeholder(kind)
    allowed = range_of(cls, field.name) if kind in (float, int) else None
    if allowed is not None and (wrong := objection(value, allowed)):
        mistakes.add(path, wrong)
        return _placeholder(kind) if field.default is msgspec.NODEFAULT else field.default
    if isinstance(value, float) and not math.isfinite(value):
        mistakes.add(path, f"must be a finite number, got {value}")
    return value


def _unknown_key(key: str, cls: type, known: list[str]) -> str:
    """What to write instead of an unknown key."""
    bare, _, unit = key.rpartition("_")
    stems = [key] + ([bare] if unit in _KNOWN_UNITS else [])
    for stem in stems:
        for right, word in _UNIT_WORDS.items():
            if f"{stem}_{right}" in known:
                return f"unknown key; write {stem}_{right}, {word}"
        if stem in known and stem != key:
            return f"unknown key; write {stem}"
    tables = _tables()
    for where, table in tables.items() if cls in tables.values() else ():
        if table is not cls and any(key == key_of(table, field) for field in msgspec.structs.fields(table)):
            return f"unknown key here; it belongs {where}"
    return f"unknown key; {suggestion(key, known, 'keys')}"


def _tables() -> dict[str, type]:
    """Every table of the file, by the words that say where it is."""
    found: dict[str, type] = {"at the top of the file, before any table": Scenario}
    for field in msgspec.structs.fields(Scenario):
        if isinstance(field.type, type) and issubclass(field.type, msgspec.Struct):
            found[f"into [{field.encode_name}]"] = field.type
            for below in msgspec.structs.fields(field.type):
                if isinstance(below.type, type) and issubclass(below.type, msgspec.Struct):
                    found[f"into [{field.encode_name}.{below.encode_name}]"] = below.type
    found["into [case.NAME]"] = Case
    found["into [[event]]"] = typing.get_args(
        next(field for field in msgspec.structs.fields(Scenario) if field.encode_name == "event").type
    )[0]
    return found


def _wrong_type(kind: Any, raw: Any) -> str:
    if kind == Secondary:
        rules = typing.get_args(kind)[0]
        if isinstance(raw, str):
            return f'{_wrong_type(rules, raw)}; or name inverters in a list such as ["inv1", "inv4"]'
        return f'must be {_named(rules)} or a list such as ["inv1", "inv4"], got {shown(raw)}'
    if typing.get_origin(kind) is typing.Literal:
        options = [option or '""' for option in typing.get_args(kind)]
        if isinstance(raw, str):
            return f"there is no {shown(raw)}; {suggestion(raw, options, 'choices')}"
        return f"must be {_named(kind)}, got {shown(raw)}"
    hint = number_in(raw) if isinstance(raw, str) and kind in (float, int) else ""
    return f"must be {_named(kind)}, got {shown(raw)}{hint}"


def _expected(field: msgspec.structs.FieldInfo) -> str:
    if typing.get_origin(field.type) is dict:
        return f"write at least one table [{field.encode_name}.NAME]"
    if isinstance(field.type, type) and issubclass(field.type, msgspec.Struct):
        return f"write a table [{field.encode_name}]"
    return f"write {_named(field.type)}"


def _named(kind: Any) -> str:
    """Name a type for people."""
    if kind == Secondary:
        return f'{_named(typing.get_args(kind)[0])} or a list such as ["inv1", "inv4"]'
    if kind is float:
        return "a number"
    if kind is int:
        return "a whole number"
    if kind is str:
        return "a text in quotes"
    if typing.get_origin(kind) is typing.Literal:
        return "one of " + ", ".join(shown(option) for option in typing.get_args(kind))
    if typing.get_origin(kind) is dict:
        return "a table"
    if typing.get_origin(kind) is types.UnionType:
        return " or ".join(map(_named, typing.get_args(kind)))
    if typing.get_origin(kind) is tuple:
        inner = typing.get_args(kind)[0]
        if typing.get_origin(inner) is types.UnionType:
            return 'a list such as ["mine:Name"]'
        if inner in (int, float):
            return "a list of numbers"
        return 'a list of pairs such as [["inv1", "inv4"]]' if typing.get_origin(inner) else 'a list such as ["13-152"]'
    return getattr(kind, "__name__", str(kind))


def _placeholder(kind: Any) -> Any:
    """Something of a type to go on with after a mistake; nobody sees it."""
    if isinstance(kind, types.UnionType) or typing.get_origin(kind) is typing.Union:
        kind = typing.get_args(kind)[0]
    if typing.get_origin(kind) is typing.Literal:
        return typing.get_args(kind)[0]
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        given = (field for field in msgspec.structs.fields(kind) if field.default is msgspec.NODEFAULT)
        return kind(**{field.name: _placeholder(field.type) for field in given})
    origin = typing.get_origin(kind) or kind
    assert not isinstance(origin, types.UnionType)
    return origin()


def _join(path: str, key: str) -> str:
    return f"{path}.{key}" if path else key
