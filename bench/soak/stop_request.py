"""SIGTERM and Ctrl-C of a soak: the first one ends its run well, a second one ends it at once."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic
from types import FrameType

from scenarios.results.broken_folder import TerminatedError
from wire.driver.stop_signal import StopSignal

SIGNALS = (signal.SIGINT, signal.SIGTERM)
"""Taken even if the shell lets them be ignored, as a shell does with the Ctrl-C of a program in the background."""


class StopRequest:
    """Handler of signals, for `signal.signal`: it raises KeyboardInterrupt unless the soak can end well.

    Parameters
    ----------
    clock : Callable[[], float], optional
        Time (s): signals within a second are the same request.
    """

    def __init__(self, clock: Callable[[], float] = monotonic) -> None:
        self.disturbing = False
        """Whether the run is disturbed now: then it ends well, after the disturbance."""
        self.asked: signal.Signals | None = None
        """The signal that asked for it."""
        self._handle = StopSignal(TerminatedError, clock)

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Note the first request while the run is disturbed; raise at any other."""
        try:
            self._handle(number, frame)
        except TerminatedError:
            first, self.asked = self.asked is None, self.asked or signal.Signals(number)
            if not (first and self.disturbing):
                raise

    @property
    def exit_code(self) -> int:
        """Exit code of a soak that it ended: 128 and the number of the signal; 0 of one that it did not."""
        return 0 if self.asked is None else 128 + self.asked


@contextmanager
def stop_request() -> Iterator[StopRequest]:
    """Take the signals that end a program while the context is open."""
    request = StopRequest()
    before = {number: signal.signal(number, request) for number in SIGNALS}
    try:
        yield request
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
