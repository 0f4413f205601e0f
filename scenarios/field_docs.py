"""Reference pages from the code: the sentence, type, unit, range and default of each field of a class."""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Iterable, Iterator
from itertools import pairwise
from types import ModuleType
from typing import Any, NamedTuple

import msgspec

from gridpeers.wire.schema.table_schema import INLINE, NO_KEY, Field, OtherKeys, fields_of
from gridpeers.wire.schema.type_words import in_words, kinds_of, shown


class FieldDoc(NamedTuple):
    """The documentation of one field."""

    name: str
    type: str
    """The annotation as written in the source."""
    text: str
    """The docstring under the field, on one line."""


def field_docs(cls: type) -> tuple[FieldDoc, ...]:
    """Return the fields of a class with their docstrings, those of its base classes first.

    Parameters
    ----------
    cls : type
        A class whose source is at hand; of one without source there is none.

    Examples
    --------
    >>> from gridpeers.plant.plant_config import SwitchEvent
    >>> [doc.name for doc in field_docs(SwitchEvent)]
    ['t', 'switch', 'action', 'synchronised']
    >>> field_docs(SwitchEvent)[0].text
    'Time (s), a multiple of h.'
    """
    written: dict[str, FieldDoc] = {}
    for base in reversed(cls.__mro__):
        if base not in (object, msgspec.Struct):
            written |= _written_in(base)
    names = cls.__struct_fields__ if issubclass(cls, msgspec.Struct) else tuple(written)
    return tuple(written[name] for name in names)


def field_table(cls: type, *, left_out: Iterable[str] = ()) -> Iterator[str]:
    """Yield a table of the fields of a class: key, type, unit, range, default and meaning; none without fields."""
    skipped, docs = set(left_out), {doc.name: doc.text for doc in field_docs(cls)}
    rows = []
    for field in fields_of(cls):
        if not (field.name in skipped or INLINE in field.marks or NO_KEY in field.marks):
            text = field.help or docs.get(field.name, "")
            key = '"mine:Name"' if field.mark(OtherKeys) else field.key
            rows.append((f"`{key}`", _type(field), field.unit, field.span, _default(field), text))
    if rows:
        yield from markdown_table(("key", "type", "unit", "range", "default", "meaning"), rows)


def markdown_table(header: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> Iterator[str]:
    """Yield the lines of a table."""
    yield f"| {' | '.join(header)} |"
    yield f"|{'---|' * len(header)}"
    for row in rows:
        yield f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |"


def alias_docs(module: ModuleType) -> tuple[tuple[str, str], ...]:
    """Return names and docstrings of the annotated types that a module defines for its fields.

    Examples
    --------
    >>> from gridpeers.wire import bounds
    >>> dict(alias_docs(bounds))["Rating"]
    'Rating (W): positive, at most a gigawatt.'
    """
    body = ast.parse(inspect.getsource(module)).body
    return tuple(
        (ast.unparse(statement.targets[0]), _one_line(after.value.value))
        for statement, after in pairwise(body)
        if isinstance(statement, ast.Assign) and ast.unparse(statement.value).startswith("Annotated[")
        if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
    )


def class_doc(cls: type) -> str:
    """Return the docstring of a class on one line."""
    return _one_line(inspect.getdoc(cls) or "")


def _written_in(cls: type) -> dict[str, FieldDoc]:
    """Return the fields in the body of one class, by name."""
    try:
        definition = ast.parse(textwrap.dedent(inspect.getsource(cls))).body[0]
    except (OSError, TypeError):  # of a class that was made, or written in a notebook
        return {}
    assert isinstance(definition, ast.ClassDef)
    found: dict[str, FieldDoc] = {}
    for statement, after in zip(definition.body, [*definition.body[1:], None], strict=True):
        if isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name):
            is_text = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
            text = _one_line(after.value.value) if is_text else ""  # type: ignore[union-attr]
            found[statement.target.id] = FieldDoc(statement.target.id, ast.unparse(statement.annotation), text)
    return found


def _one_line(text: object) -> str:
    return " ".join(str(text).split())


def _type(field: Field) -> str:
    """Return the type in words; the keys of a table stand in a section of its own."""
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
