"""Foreign code that gridpeers calls: its exceptions in words, and what it does to standard output. Pure."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from gridpeers.wire.wording import printable

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
    ' (foreign_code.py'
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


class ForeignError(Exception):
    """Foreign code raised a `BaseException`, such as a panic of Rust (polars, zenoh) or `CancelledError`."""


@contextmanager
def foreign_code() -> Iterator[None]:
    """Guard a call of foreign code: put standard output and error back afterwards.

    Raises
    ------
    ForeignError
        For what else was raised, so that `except ANYTHING` has it too; only Ctrl+C passes as it is.

    Examples
    --------
    >>> with foreign_code():
    ...     sys.stdout = 3
    >>> print("still here")
    still here
    """
    before = sys.stdout, sys.stderr
    try:
        yield
    except BaseException as error:
        if isinstance(error, (*ANYTHING, KeyboardInterrupt)):
            raise
        raise ForeignError(named(error)).with_traceback(error.__traceback__) from error
    finally:
        sys.stdout, sys.stderr = before
