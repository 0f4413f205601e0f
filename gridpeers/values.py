"""Python values as a scenario file would hold them: numbers, texts, lists, tables, and references of classes."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from pathlib import PurePath
from typing import Any


def plain(value: Any) -> Any:
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
    if isinstance(value, Enum):
        return plain(value.value)
    if isinstance(value, bool) or value is None:
        return value
    if isinstance(value, str | int | float):
        return next(kind(value) for kind in (str, int, float) if isinstance(value, kind))
    if isinstance(value, PurePath):
        return str(value)
    if isinstance(value, Mapping):
        return {str(key): plain(below) for key, below in value.items()}
    if isinstance(value, list | tuple | set | frozenset | range):
        return [plain(item) for item in (sorted(value) if isinstance(value, set | frozenset) else value)]
    if hasattr(value, "__qualname__") and hasattr(value, "__module__"):
        return _reference(value)
    if callable(getattr(value, "tolist", None)):  # numpy and pandas, which need not be imported for this
        return plain(value.tolist())
    raise ValueError(
        f"a value of type {type(value).__name__} is none of a scenario's; give a number, text, list or table"
    )


def _reference(it: Any) -> str:
    if "<" in it.__qualname__:
        raise ValueError(
            f"{it.__qualname__} is defined inside a function, where nobody can import it; define it at the top of a "
            "module or of the notebook"
        )
    return f"{it.__module__}:{it.__qualname__}"
