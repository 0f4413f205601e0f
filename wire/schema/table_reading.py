"""Convert the tables of a file by the annotations of a class, collect every problem, and say what a key takes. Pure."""

from __future__ import annotations

import functools
import json
import operator
import types
import typing
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal, TypeVar, get_args, get_origin

import msgspec

from gridpeers.wire.schema.table_schema import (
    INHERITED,
    INLINE,
    NO_KEY,
    ChosenBy,
    Example,
    Field,
    NamedTables,
    OtherKeys,
    Problem,
    below,
    contradictions,
    fields_of,
    number_in,
)
from gridpeers.wire.wording import printable, suggestion

T = TypeVar("T", bound=msgspec.Struct)

_KIND_WORDS = {
    float: "a number",
    int: "a whole number",
    str: "a text in quotes",
    bool: "true or false",
    dict: "a table",
}


def read_table(struct: type[T], data: Mapping[str, Any]) -> tuple[T, list[Problem]]:
    """Convert a file's tables to a struct, which is of use only without problems.

    A key with a problem has its default, so that later checks find what else is wrong.

    Examples
    --------
    >>> from gridpeers.netem.schema.netem import Netem
    >>> netem, problems = read_table(Netem, {"link": [{"on": "* <-> *", "delay": "20 ms", "los": 0.1}]})
    >>> for path, text in problems:  # doctest: +ELLIPSIS
    ...     print(f"{path}: {text}")
    link[0].los: unknown key; did you mean "loss"? The keys are on, from_s, to_s, profile, delay, loss, duplicate, ...
    link[0].delay: must be a number or a table with a model, got "20 ms"; write 0.02
    """
    reader = _Reader(struct)
    return reader.table(struct, data, ""), reader.problems


def read_parameters(cls: type, given: Mapping[str, Any]) -> tuple[dict[str, Any], list[Problem]]:
    """Return the value of every parameter of a class, such as a law, by name; they are of use only without problems."""
    reader = _Reader(cls, "parameter")
    return reader.values(cls, given, ""), reader.problems


def parameter_values(cls: type, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the value of every parameter of a class; raise ValueError with all problems if one is wrong or missing."""
    values, problems = read_parameters(cls, given)
    if problems:
        raise ValueError("; ".join(f"{name}: {text}" for name, text in problems))
    return values


class _Reader:
    """Reads one file whose top table is `root`; `noun` is the word for a key."""

    def __init__(self, root: type, noun: str = "key") -> None:
        self._root, self._noun = root, noun
        self._top: dict[str, Any] = {}
        self.problems: list[Problem] = []

    def table(self, struct: type[T], data: Any, path: str, base: T | None = None) -> T:
        """Convert one table; what it leaves out comes from `base`, without one from the defaults."""
        return struct(**self.values(struct, data, path, base))

    def values(self, cls: type, data: Any, path: str, base: Any = None) -> dict[str, Any]:
        noted = len(self.problems)
        values: dict[str, Any] = self._top if cls is self._root else {}
        is_table = isinstance(data, Mapping)
        if not is_table:
            self._add(path, f"must be a table with the {self._noun}s {', '.join(_names(cls))}, got {shown(data)}")
            data = {}
        plain = [field for field in fields_of(cls) if _is_plain(field)]
        rest = dict(data)
        for key in (_tag_field(cls), *(field.key for field in plain)):
            rest.pop(key, None)
        for field in fields_of(cls):
            if INLINE in field.marks:
                kind, rest = self._kind(field, rest, path)
                own = {key: rest.pop(key) for key in keys_of(kind) if key in rest}
                values[field.name] = self.table(kind, own, path)
            elif others := field.mark(OtherKeys):
                found: list[Problem] = []
                accepted = [*filter(others.accepts, rest)]
                values[field.name] = tuple(it for key in accepted for it in others.read(key, rest.pop(key), found))
                self.problems += below(path, found)
            elif named := field.mark(NamedTables):
                tables = named.known() if rest else {}
                values[field.name] = {
                    key: self.table(tables[key], rest.pop(key), _join(path, key)) for key in [*rest] if key in tables
                }
        for key in rest:
            self._add(_join(path, key), self._unknown(key, cls, path))
        for field in plain:
            place, start = _join(path, field.key), self._top.get(field.name) if INHERITED in field.marks else None
            if field.key in data:
                values[field.name] = self._value(field, data[field.key], place, start)
            elif base is not None or start is not None:
                values[field.name] = getattr(base, field.name) if base is not None else start
            else:
                values[field.name] = _fallback(field)
                if field.required and is_table:
                    self._add(place, f"is missing; {_expected(field)}")
        if is_table:
            wrong = {problem.path for problem in self.problems[noted:]}
            right = types.SimpleNamespace(**values)
            self.problems += below(path, contradictions(cls, right, lambda field: _join(path, field.key) not in wrong))
        return values

    def _value(self, field: Field, raw: Any, path: str, base: Any) -> Any:
        """Convert the value of one key; return the default for a wrong one."""
        kind = _without_none(field.type)
        structs, table, container = _structs_in(kind), table_of(kind), get_origin(kind)
        if table is not None and container is None:
            return self.table(*self._kind(field, raw, path), path, base)
        if structs and isinstance(raw, Mapping):
            before, chosen = len(self.problems), self._chosen(structs, raw, path)
            value = self.table(chosen, raw, path) if chosen else None
            return value if len(self.problems) == before else _fallback(field)
        if table is not None and container is tuple:
            if isinstance(raw, list):
                return tuple(self.table(table, item, f"{path}[{i}]") for i, item in enumerate(raw))
            self._add(path, f"must be written as [[{path}]], got {shown(raw)}")
            return ()
        if table is not None:
            if isinstance(raw, Mapping) and all(isinstance(item, Mapping) for item in raw.values()):
                return {name: self.table(table, item, f"{path}.{name}") for name, item in raw.items()}
            example = field.mark(Example)
            right = f"a table such as {example.text}" if example else f"written as tables [{path}.NAME]"
            self._add(path, f"must be {right}, got {shown(raw)}")
            return {}
        try:
            value, wrong = msgspec.convert(raw, kind), ""
        except msgspec.ValidationError:
            value, wrong = None, _wrong_type(field, raw)
        if isinstance(value, str) and not value.isprintable() and self._noun == "key":
            wrong = f"has characters that cannot be printed: {value!a}; write letters, digits and signs"
        elif isinstance(value, int | float) and not isinstance(value, bool):
            wrong = field.objection(value)
        if wrong:
            self._add(path, wrong)
            return _fallback(field)
        return value

    def _kind(self, field: Field, raw: Any, path: str) -> tuple[type[Any], Any]:
        """Return the struct as which a table is read, and what to read: of one that names none its known keys."""
        by, kind = field.mark(ChosenBy), _without_none(field.type)
        if by is None or not isinstance(raw, Mapping):
            return kind, raw
        try:
            return by.choose(raw), raw
        except ValueError as error:
            self._add(_join(path, by.key), str(error))
            return kind, {key: value for key, value in raw.items() if key in keys_of(kind) and key != by.key}

    def _chosen(self, structs: list[type[T]], raw: Mapping[str, Any], path: str) -> type[T] | None:
        if len(structs) == 1:
            return structs[0]
        tags = {str(struct.__struct_config__.tag): struct for struct in structs}
        key = str(_tag_field(structs[0]))
        tag = raw.get(key)
        if key not in raw:
            self._add(_join(path, key), f"is missing; write one of {', '.join(tags)}")
        elif tag not in [*tags]:  # it may be a table
            self._add(_join(path, key), f"there is no {shown(tag)}; {suggestion(str(tag), tags, f'{key}s')}")
        else:
            return tags[str(tag)]
        return None

    def _unknown(self, key: str, cls: type, path: str) -> str:
        """Say what to write instead of an unknown key."""
        known = [*_names(cls)]
        if f"{key}s" not in known:
            places = [("at the top of the file, before any table", self._root)]
            for where, table in [*places, *((f"into {title}", table) for title, table in tables_in(self._root))]:
                if table is not cls and where != f"into [{path}]" and key in keys_of(table):
                    return f"unknown key here; it belongs {where}"
        return f"unknown {self._noun}; {suggestion(key, known, f'{self._noun}s')}"

    def _add(self, path: str, text: str) -> None:
        self.problems.append(Problem(path, text))


def _is_plain(field: Field) -> bool:
    """Return whether the field has one key of its own."""
    return not (INLINE in field.marks or NO_KEY in field.marks or field.mark((OtherKeys, NamedTables)))


def keys_of(struct: type) -> list[str]:
    """Return the keys of a table, less those by which fields take any name."""
    return [field.key for field in fields_of(struct) if _is_plain(field)]


def _names(cls: type) -> Iterator[str]:
    """Yield all that may be written in a table."""
    for field in fields_of(cls):
        if _is_plain(field):
            yield field.key
        elif named := field.mark(NamedTables):
            yield from named.known()
    for field in fields_of(cls):
        if INLINE in field.marks:
            yield from _names(field.type)


def tables_in(cls: type, path: str = "") -> Iterator[tuple[str, type]]:
    """Yield the tables below one as a file names them, such as `[[link]]` or `[load.NAME]`, and their structs."""
    for field in fields_of(cls):
        key, container = _join(path, field.key), get_origin(field.type)
        if INLINE in field.marks:
            yield from tables_in(field.type, path)
        elif named := field.mark(NamedTables):
            yield from ((f"[{path}.{name}]", table) for name, table in named.known().items())
        elif (table := table_of(field.type)) and not field.mark(OtherKeys):
            name = f"{key}.NAME" if container is dict else key
            yield f"[[{key}]]" if container is tuple else f"[{name}]", table
            yield from tables_in(table, name)


def table_of(kind: Any) -> type[msgspec.Struct] | None:
    """Return the struct that is a type, or that is in its `tuple[Struct, ...]` or `dict[str, Struct]`; else None."""
    place = {tuple: 0, dict: 1}.get(get_origin(kind))
    inner = kind if place is None else get_args(kind)[place]
    return inner if _structs_in(inner) == [inner] else None


def _tag_field(cls: type) -> str | None:
    return cls.__struct_config__.tag_field if issubclass(cls, msgspec.Struct) else None


def _fallback(field: Field) -> Any:
    return _placeholder(field.type) if field.required else field.default


def _placeholder(kind: Any) -> Any:
    """Return a value of a type in place of a missing one."""
    kind = kinds_of(kind)[0]
    if get_origin(kind) is Literal:
        return get_args(kind)[0]
    if _structs_in(kind):
        return kind(**{field.name: _placeholder(field.type) for field in fields_of(kind) if field.required})
    return (get_origin(kind) or kind)()


def _join(path: str, key: str) -> str:
    return f"{path}.{key}" if path else key


def kinds_of(kind: Any) -> tuple[Any, ...]:
    """Return the types of which a value may be one; None is left out, as TOML has no null."""
    parts = get_args(kind) if get_origin(kind) in (types.UnionType, typing.Union) else (kind,)
    return tuple(part for part in parts if part is not types.NoneType)


def _without_none(kind: Any) -> Any:
    return functools.reduce(operator.or_, kinds_of(kind))


def _structs_in(kind: Any) -> list[Any]:
    return [part for part in kinds_of(kind) if isinstance(part, type) and issubclass(part, msgspec.Struct)]


def shown(raw: object) -> str:
    try:
        text = json.dumps(raw, ensure_ascii=False, default=str)
    except (TypeError, ValueError, RecursionError):  # what Python has and no file
        text = repr(raw)
    return printable(text, 1000)


def in_words(*kinds: Any) -> str:
    """Return types in words, such as 'one of "a", "b" or a list of numbers'."""
    kinds = tuple(part for kind in kinds for part in kinds_of(kind))
    words = dict.fromkeys(_word(kind, kinds) for kind in sorted(kinds, key=lambda kind: bool(_structs_in(kind))))
    return " or ".join(words)


def _word(kind: Any, kinds: Sequence[Any]) -> str:
    origin = get_origin(kind)
    if origin is Literal:
        return "one of " + ", ".join(shown(choice) for choice in get_args(kind) if choice)
    if _structs_in(kind):
        several = sum(bool(_structs_in(other)) for other in kinds) > 1
        return f"a table with {f'a {_tag_field(kind)}' if several else 'the keys ' + ', '.join(keys_of(kind))}"
    if origin in (tuple, list):
        inner = get_args(kind)[0]
        if inner in (int, float):
            return "a list of numbers"
        if get_origin(inner) is Literal:
            return f"a list with {_word(inner, kinds)}"
        pairs = get_origin(inner) is tuple and Ellipsis not in get_args(inner)
        return "a list of pairs" if pairs else "a list of lists" if get_origin(inner) is tuple else "a list"
    return _KIND_WORDS.get(origin or kind, getattr(kind, "__name__", str(kind)))


def _with_example(kinds: Sequence[Any], field: Field) -> str:
    example = field.mark(Example)
    return in_words(*kinds) + (f" such as {example.text}" if example else "")


def _wrong_type(field: Field, raw: Any) -> str:
    kinds = kinds_of(field.type)
    literal = next((kind for kind in kinds if get_origin(kind) is Literal), None)
    if literal is not None and isinstance(raw, str):
        rest = [kind for kind in kinds if kind is not literal]
        more = f"; or write {_with_example(rest, field)}" if rest else ""
        choices = [choice for choice in get_args(literal) if choice]
        return f"there is no {shown(raw)}; {suggestion(raw, choices, 'choices')}{more}"
    hint = number_in(raw) if isinstance(raw, str) and {float, int} & {*kinds} else ""
    return f"must be {_with_example(kinds, field)}, got {shown(raw)}{hint}"


def _expected(field: Field) -> str:
    kind, example = _without_none(field.type), field.mark(Example)
    if get_origin(kind) is dict:
        return f"write at least one table [{field.key}.NAME]"
    if _structs_in(kind) == [kind]:
        return f"write a table [{field.key}]"
    if kind is str and example:
        return f"write {field.key} = {example.text}"
    return f"write {_with_example(kinds_of(field.type), field)}"
