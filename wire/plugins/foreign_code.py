"""Standard output and error, which foreign code in this process may replace, and its exceptions. Pure."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from wire.plugins.anybody import ANYTHING, named


class ForeignError(Exception):
    """What foreign code raised is no `Exception`: a panic of Rust (polars, zenoh), `CancelledError`, ..."""


@contextmanager
def foreign_code() -> Iterator[None]:
    """Put standard output and error back afterwards.

    Raises
    ------
    ForeignError
        For whatever else was raised, so that `except ANYTHING` has it too; only Ctrl+C passes as it is.

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
    except (*ANYTHING, KeyboardInterrupt):
        raise
    except BaseException as error:
        raise ForeignError(named(error)).with_traceback(error.__traceback__) from error
    finally:
        sys.stdout, sys.stderr = before
