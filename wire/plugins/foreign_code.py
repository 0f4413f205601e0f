"""A guard around foreign code in this process: its exceptions, and what it does to standard output. Pure."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager


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
        from gridpeers.wire.plugins.anybody import (  # brings msgspec, for which a list of scenarios need not wait
            ANYTHING,
            named,
        )

        if isinstance(error, (*ANYTHING, KeyboardInterrupt)):
            raise
        raise ForeignError(named(error)).with_traceback(error.__traceback__) from error
    finally:
        sys.stdout, sys.stderr = before
