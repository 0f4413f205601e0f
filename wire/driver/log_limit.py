"""A log in which lines that repeat themselves do not drown the others."""

from __future__ import annotations

import logging
from time import monotonic

from wire.rate_limit import RateLimit


class LogLimit(logging.Filter):
    """Leaves out of a log what repeats itself, and tells how much that was."""

    def __init__(self) -> None:
        super().__init__()
        self._limit = RateLimit()

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether a line is written; its text then tells of those before it that were not."""
        line = self._limit.admit(record.getMessage(), monotonic())
        if line is not None:
            record.msg, record.args = line, ()
        return line is not None

    def left_out(self) -> list[str]:
        """What is yet to be told of lines that were left out."""
        return self._limit.left_out()


def limit_log(log: logging.Logger) -> LogLimit:
    """Have a log leave out what repeats itself; a second call changes nothing."""
    for known in log.filters:
        if isinstance(known, LogLimit):
            return known
    limit = LogLimit()
    log.addFilter(limit)
    return limit
