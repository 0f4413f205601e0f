"""Standard output and error, which foreign code in this process may replace by anything. Pure."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def unreplaced() -> Iterator[None]:
    """Put standard output and error back afterwards.

    Examples
    --------
    >>> with unreplaced():
    ...     sys.stdout = 3
    >>> print("still here")
    still here
    """
    before = sys.stdout, sys.stderr
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before
