"""Foreign code that gridpeers calls: its exceptions, and their text on one line. Pure."""

from __future__ import annotations

from wire.printable import printable

ANYTHING = (Exception, SystemExit, GeneratorExit)
"""Exceptions of foreign code; only Ctrl+C ends the run."""


def named(error: BaseException) -> str:
    """Return an error as one line; its text may fail too.

    Examples
    --------
    >>> named(SystemExit(3))
    'SystemExit: 3'
    """
    try:
        text = str(error)
    except ANYTHING:
        text = "its text cannot be had"
    return printable(f"{type(error).__name__}: {text}", 200)
