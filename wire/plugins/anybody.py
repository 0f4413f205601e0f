"""Foreign code that gridpeers calls: its exceptions, and their text on one line. Pure."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gridpeers.wire.printable import printable

ANYTHING = (Exception, SystemExit, GeneratorExit)
"""Exceptions of foreign code; only Ctrl+C ends the run."""

LONGEST_NAME = 100
"""Characters of the name of a file that a message shows, from its end."""


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


def line_of(function: Callable[..., Any], error: BaseException, folder: str = "") -> str:
    """Return where foreign code failed, as " (mine.py:12)": the innermost line in the folder of a function's file.

    Without a traceback, as of a function that returned something wrong, it is the line of the function. A file in
    `folder`, by default that of the function, is named from there. Empty for a function that is not written in Python.

    Examples
    --------
    >>> line_of(line_of, ValueError()).partition(":")[0]
    ' (anybody.py'
    """
    of_instance = getattr(type(function), "__call__", None)  # noqa: B004 - its code is wanted
    code = getattr(function, "__code__", None) or getattr(of_instance, "__code__", None)
    if code is None:
        return ""
    file, line, home = code.co_filename, code.co_firstlineno, code.co_filename.rpartition("/")[0]
    step = (error.__cause__ or error).__traceback__
    while step is not None:
        if step.tb_frame.f_code.co_filename.rpartition("/")[0] == home:
            file, line = step.tb_frame.f_code.co_filename, step.tb_lineno
        step = step.tb_next
    name = printable(file.removeprefix(f"{folder or home}/"))
    return f" ({name if len(name) <= LONGEST_NAME else '...' + name[-LONGEST_NAME:]}:{line})"
