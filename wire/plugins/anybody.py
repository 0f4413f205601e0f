"""Code of anybody's that gridpeers calls: what it may raise, and how that is told. Pure."""

from __future__ import annotations

from wire.printable import printable

ANYTHING = (Exception, SystemExit, GeneratorExit)
"""What anybody's code may raise; only who presses Ctrl+C ends the run."""


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
