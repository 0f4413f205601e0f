"""The sentence under each field of a class, read from its source, so that printed documentation cannot age."""

from __future__ import annotations

import ast
import inspect
import textwrap
from itertools import pairwise
from types import ModuleType
from typing import NamedTuple

import msgspec


class FieldDoc(NamedTuple):
    """What a reader of the documentation wants to know of one field."""

    name: str
    type: str
    """The annotation as written in the source."""
    default: str
    """The default as Python writes it, or "" when the field must be given."""
    text: str
    """The docstring under the field, on one line."""


def field_docs(cls: type[msgspec.Struct]) -> tuple[FieldDoc, ...]:
    """Fields of a struct with their docstrings, those of its base classes first.

    Parameters
    ----------
    cls : type[msgspec.Struct]
        A struct whose source is at hand.

    Examples
    --------
    >>> from plant.plant_config import SwitchEvent
    >>> [doc.name for doc in field_docs(SwitchEvent)]
    ['t', 'switch', 'action', 'synchronised']
    >>> field_docs(SwitchEvent)[0].text
    'Time (s), a multiple of h.'
    """
    written: dict[str, tuple[str, str]] = {}
    for base in reversed(cls.__mro__):
        if issubclass(base, msgspec.Struct) and base is not msgspec.Struct:
            written |= _fields_written_in(base)
    return tuple(
        FieldDoc(field.encode_name, written[field.name][0], _default(field), written[field.name][1])
        for field in msgspec.structs.fields(cls)
    )


def alias_docs(module: ModuleType) -> tuple[tuple[str, str], ...]:
    """Names and docstrings of the annotated types that a module defines for its fields.

    Examples
    --------
    >>> from wire import bounds
    >>> dict(alias_docs(bounds))["Rating"]
    'W: more than none, and at most a gigawatt.'
    """
    body = ast.parse(inspect.getsource(module)).body
    return tuple(
        (ast.unparse(statement.targets[0]), " ".join(str(after.value.value).split()))
        for statement, after in pairwise(body)
        if isinstance(statement, ast.Assign) and ast.unparse(statement.value).startswith("Annotated[")
        if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
    )


def class_doc(cls: type) -> str:
    """Docstring of a class on one line."""
    return " ".join((inspect.getdoc(cls) or "").split())


def _fields_written_in(cls: type) -> dict[str, tuple[str, str]]:
    """Annotation and docstring of each field in the body of one class."""
    definition = ast.parse(textwrap.dedent(inspect.getsource(cls))).body[0]
    assert isinstance(definition, ast.ClassDef)
    found: dict[str, tuple[str, str]] = {}
    for statement, after in zip(definition.body, [*definition.body[1:], None], strict=True):
        if isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name):
            text = ""
            if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
                text = " ".join(str(after.value.value).split())
            found[statement.target.id] = (ast.unparse(statement.annotation), text)
    return found


def _default(field: msgspec.structs.FieldInfo) -> str:
    if field.default is not msgspec.NODEFAULT:
        return repr(field.default)
    return "" if field.default_factory is msgspec.NODEFAULT else repr(field.default_factory())
