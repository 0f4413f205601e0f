"""Types of fields in words, for problems and reference pages: what a key takes, and what was written instead. Pure."""

from __future__ import annotations

import functools
import json
import operator
import types
import typing
from typing import Any, Literal, get_args, get_origin

import msgspec

from gridpeers.wire.printable import printable
from gridpeers.wire.schema.plausible import number_in
from gridpeers.wire.schema.suggestion import suggestion
from gridpeers.wire.schema.table_schema import NO_KEY, Example, Field, OtherKeys, fields_of

_KIND_WORDS = {
    float: "a number",
    int: "a whole number",
    str: "a text in quotes",
    bool: "true or false",
    dict: "a table",
}


def shown(raw: object) -> str:
    """Return a value as TOML writes it, or nearly."""
    try:
        text = json.dumps(raw, ensure_ascii=False, default=str)
    except (TypeError, ValueError, RecursionError):  # what Python has and no file
        text = repr(raw)
    return printable(text, 1000)


def in_words(*kinds: Any) -> str:
    """Return types in words.

    Examples
    --------
    >>> in_words(Literal["a", "b"], list[float])
    'one of "a", "b" or a list of numbers'
    """
    kinds = tuple(part for kind in kinds for part in kinds_of(kind))
    words = dict.fromkeys(_word(kind, kinds) for kind in sorted(kinds, key=lambda kind: bool(structs_in(kind))))
    return " or ".join(words)


def wrong_type(field: Field, raw: Any) -> str:
    """Say what a key takes in place of a value of another type."""
    kinds = kinds_of(field.type)
    literal = next((kind for kind in kinds if get_origin(kind) is Literal), None)
    if literal is not None and isinstance(raw, str):
        rest = [kind for kind in kinds if kind is not literal]
        more = f"; or write {_named(rest, field)}" if rest else ""
        choices = [choice for choice in get_args(literal) if choice]
        return f"there is no {shown(raw)}; {suggestion(raw, choices, 'choices')}{more}"
    hint = number_in(raw) if isinstance(raw, str) and {float, int} & {*kinds} else ""
    return f"must be {_named(kinds, field)}, got {shown(raw)}{hint}"


def expected(field: Field) -> str:
    """Say what to write for a key that is missing."""
    kind, example = without_none(field.type), field.mark(Example)
    if get_origin(kind) is dict:
        return f"write at least one table [{field.key}.NAME]"
    if structs_in(kind) == [kind]:
        return f"write a table [{field.key}]"
    if kind is str and example:
        return f"write {field.key} = {example.text}"
    return f"write {_named(kinds_of(kind), field)}"


def kinds_of(kind: Any) -> tuple[Any, ...]:
    """Return the types of which a value may be one; None is none, as TOML has no null."""
    return tuple(part for part in _parts(kind) if part is not types.NoneType)


def structs_in(kind: Any) -> list[Any]:
    """Return the structs that a value may be."""
    return [part for part in kinds_of(kind) if isinstance(part, type) and issubclass(part, msgspec.Struct)]


def inner_struct(kind: Any, container: type) -> type[msgspec.Struct] | None:
    """Return the struct in a `tuple[Struct, ...]` or a `dict[str, Struct]`."""
    if get_origin(kind) is not container:
        return None
    inner = get_args(kind)[1 if container is dict else 0]
    return inner if structs_in(inner) == [inner] else None


def keys_of(struct: type) -> list[str]:
    """Return the keys of a table."""
    return [field.key for field in fields_of(struct) if not (NO_KEY in field.marks or field.mark(OtherKeys))]


def _named(kinds: typing.Sequence[Any], field: Field) -> str:
    """Name what a key takes, for people, with an example."""
    example = field.mark(Example)
    return in_words(*kinds) + (f" such as {example.text}" if example else "")


def _word(kind: Any, kinds: typing.Sequence[Any]) -> str:
    """Name one type."""
    origin = get_origin(kind)
    if origin is Literal:
        return "one of " + ", ".join(shown(choice) for choice in get_args(kind) if choice)
    if structs_in(kind):
        several = sum(bool(structs_in(other)) for other in kinds) > 1
        keys = f"a {kind.__struct_config__.tag_field}" if several else f"the keys {', '.join(keys_of(kind))}"
        return f"a table with {keys}"
    if origin in (tuple, list):
        inner = get_args(kind)[0]
        if inner in (int, float):
            return "a list of numbers"
        if get_origin(inner) is Literal:
            return f"a list with {_word(inner, kinds)}"
        pairs = get_origin(inner) is tuple and Ellipsis not in get_args(inner)
        return "a list of pairs" if pairs else "a list of lists" if get_origin(inner) is tuple else "a list"
    return _KIND_WORDS.get(origin or kind, getattr(kind, "__name__", str(kind)))


def without_none(kind: Any) -> Any:
    """Return a type without None: TOML has no null."""
    return functools.reduce(operator.or_, kinds_of(kind))


def _parts(kind: Any) -> tuple[Any, ...]:
    return get_args(kind) if get_origin(kind) in (types.UnionType, typing.Union) else (kind,)
