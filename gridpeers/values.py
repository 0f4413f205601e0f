"""Python values as a scenario file would hold them: numbers, texts, lists, tables, and references of classes."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from pathlib import PurePath
from typing import Any

DEEPEST = 20
"""Levels of tables and lists beyond which no scenario goes."""


def plain(value: Any, depth: int = 0) -> Any:
    """Return a value as TOML has it.

    Tuples become lists, numpy's scalars and arrays become numbers and lists, paths become texts, and a class or a
    function, e.g. a control law, becomes its reference `module:Name`.

    Raises
    ------
    ValueError
        If a scenario file could not hold the value; the text is a sentence.

    Examples
    --------
    >>> import collections
    >>> plain({"links": (("inv1", "inv4"),), "law": collections.Counter})
    {'links': [['inv1', 'inv4']], 'law': 'collections:Counter'}
    """
    if depth > DEEPEST:
        raise ValueError(f"tables and lists are nested more than {DEEPEST} levels deep; does one contain itself?")
    if isinstance(value, Enum):
        return plain(value.value, depth)
    if isinstance(value, bool) or value is None:
        return value
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, int | float):
        return next(kind(value) for kind in (int, float) if isinstance(value, kind))
    if isinstance(value, PurePath):
        return str(value)
    if isinstance(value, Mapping):
        return {_text(str(key)): plain(below, depth + 1) for key, below in value.items()}
    if isinstance(value, list | tuple | set | frozenset | range):
        items = value if not isinstance(value, set | frozenset) else sorted(value, key=lambda it: (str(type(it)), it))
        return [plain(item, depth + 1) for item in items]
    if hasattr(value, "__qualname__") and hasattr(value, "__module__"):
        return _reference(value)
    if callable(getattr(value, "tolist", None)):  # numpy and pandas, which need not be imported for this
        return plain(value.tolist(), depth + 1)
    raise ValueError(
        f"a value of type {type(value).__name__} is none of a scenario's; give a number, text, list or table"
    )


def _text(text: str) -> str:
    """Return a text of Python's own type, if a file could hold it."""
    try:
        text.encode()
    except UnicodeEncodeError:
        raise ValueError("has half a character in it, which no file can hold") from None
    return str(text)


def _reference(it: Any) -> str:
    if "<" in it.__qualname__:
        raise ValueError(
            f"{it.__qualname__} is defined inside a function, where nobody can import it; define it at the top of a "
            "module or of the notebook"
        )
    return f"{it.__module__}:{it.__qualname__}"
