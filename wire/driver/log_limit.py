"""Limit repeated lines in a log, so that they do not drown the others."""

from __future__ import annotations

import logging
from time import monotonic

from gridpeers.wire.rate_limit import RateLimit


class LogLimit(logging.Filter):
    """Omit repeated lines from a log, and count them."""

    def __init__(self) -> None:
        super().__init__()
        self._limit = RateLimit()

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether to write a line; add the number of omitted lines before it to its text."""
        line = self._limit.admit(record.getMessage(), monotonic())
        if line is not None:
            record.msg, record.args = line, ()
        return line is not None

    def left_out(self) -> list[str]:
        """Take out one line per kind on its omitted lines."""
        return self._limit.left_out()


def limit_log(log: logging.Logger) -> LogLimit:
    """Let a log omit repeated lines; a second call changes nothing."""
    for filter_ in log.filters:
        if isinstance(filter_, LogLimit):
            return filter_
    limit = LogLimit()
    log.addFilter(limit)
    return limit
