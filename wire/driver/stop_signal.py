"""A signal that asks a process to end: the first one counts, and what follows at once is the same request."""

from __future__ import annotations

import signal
from collections.abc import Callable
from math import inf
from time import monotonic
from types import FrameType

SAME_REQUEST_TIME = 1.0
"""Time (s) in which further signals are the same request: `timeout` signals a command and then its group, and whoever
ends all processes of a run signals those that their parent ends too. An end must not be interrupted by that."""


class StopSignal:
    """Handler of signals, for `signal.signal`.

    Parameters
    ----------
    error : Callable[[str], BaseException]
        Makes the error that it raises in the main thread, from the name of the signal.
    clock : Callable[[], float], optional
        Time (s).
    """

    def __init__(self, error: Callable[[str], BaseException], clock: Callable[[], float] = monotonic) -> None:
        self._error, self._clock = error, clock
        self._at = -inf

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Raise the error, unless it was raised less than `SAME_REQUEST_TIME` ago."""
        now = self._clock()
        if now - self._at >= SAME_REQUEST_TIME:
            self._at = now
            raise self._error(signal.Signals(number).name)
