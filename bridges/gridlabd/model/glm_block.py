"""An object of a GridLAB-D model as text."""

from __future__ import annotations

from collections.abc import Mapping

TableRow = Mapping[str, str]
"""A row of a table, by its columns."""


def block(kind: str, **properties: str | int | float | complex) -> str:
    """Write an object; names end in an underscore where Python has a keyword."""
    lines = [
        f"\t{name.removesuffix('_')} {value if isinstance(value, str) else _number(value)};"
        for name, value in properties.items()
    ]
    return "\n".join((f"object {kind} {{", *lines, "}"))


def _number(value: complex | float) -> str:
    """Write a number so that reading gives the same bits."""
    if isinstance(value, complex):
        return f"{value.real!r}{value.imag:+.17g}j"
    return repr(value)
