"""A law of anybody's in Python that may hang: it is interrupted, and has failed."""

from __future__ import annotations

import logging
import signal
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType

from agents.laws.call import ANYTHING, LawError
from agents.laws.law import LIMITS, Law, Neighbour, Own, SetPoints


class _OverError(BaseException):
    """The time is over; no Exception, so that a law that suppresses all of these is interrupted all the same."""


class TimeLimited(Law):
    """A law, each call of which may last only so long.

    Parameters
    ----------
    law : Law
        The law.
    time_limit : float
        Longest time (s of real time) of one call. It is enforced by SIGALRM: in the main thread of a process alone,
        and not against a call of C code that does not return.
    """

    def __init__(self, law: Law, time_limit: float) -> None:
        super().__init__(**{name: getattr(law, name) for name in LIMITS})
        self._law, self._time_limit = law, time_limit

    def start(self, own: Own) -> None:
        """Begin as the law does."""
        with self._limited("start", own.t):
            self._law.start(own)

    def step(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> SetPoints:
        """Decide as the law does."""
        with self._limited("step", own.t):
            return self._law.step(own, neighbours, T)

    def close(self) -> None:
        """End the law; the run is over, so that one that fails in it is but named in the log."""
        try:
            with self._limited("close", None):
                self._law.close()
        except ANYTHING as error:
            logging.getLogger(__name__).warning("law %s: close failed: %r", type(self._law).__name__, error)

    @contextmanager
    def _limited(self, what: str, t: float | None) -> Iterator[None]:
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        over = False

        def interrupt(number: int, frame: FrameType | None) -> None:
            nonlocal over
            over = True
            raise _OverError

        before = signal.signal(signal.SIGALRM, interrupt)
        try:
            signal.setitimer(signal.ITIMER_REAL, self._time_limit)
            try:
                yield
            finally:
                signal.setitimer(signal.ITIMER_REAL, 0.0)
        except BaseException:
            if not over:
                raise
        finally:
            signal.signal(signal.SIGALRM, before)
        if over:  # also where the law caught the interruption and returned
            when = "" if t is None else f" at t = {t:.6g} s"
            raise LawError(f"{what}{when} took longer than time_limit_s = {self._time_limit:g} s")
