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

Error = Callable[[str], BaseException]
"""Makes the error that a signal raises, from its name."""


class StopSignal:
    """Handler of signals, for `signal.signal`.

    Parameters
    ----------
    error : Error
        Makes the error that it raises in the main thread.
    clock : Callable[[], float], optional
        Time (s).
    """

    def __init__(self, error: Error, clock: Callable[[], float] = monotonic) -> None:
        self._error, self._clock = error, clock
        self._at = -inf
        self.requests = 0
        """Number of requests so far."""

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Raise the error, unless it was raised less than `SAME_REQUEST_TIME` ago."""
        now = self._clock()
        if now - self._at >= SAME_REQUEST_TIME:
            self._at = now
            self.requests += 1
            raise self._error(signal.Signals(number).name)


def ctrl_c_or(error: Error) -> Error:
    """Return what makes KeyboardInterrupt of SIGINT, and another error of any other signal."""
    return lambda name: KeyboardInterrupt(name) if name == signal.SIGINT.name else error(name)


def stop_at_signals(error: Error) -> StopSignal:
    """Have SIGINT raise KeyboardInterrupt in the main thread and SIGTERM another error; return their handler.

    A SIGINT that is ignored stays so: a shell ignores that of a program in the background.
    """
    stop = StopSignal(ctrl_c_or(error))
    signal.signal(signal.SIGTERM, stop)
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, stop)
    return stop
