"""Interrupt calls of foreign Python code that take too long; such a call has failed."""

from __future__ import annotations

import logging
import signal
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from time import monotonic, thread_time
from types import FrameType
from typing import Any

from gridpeers.agents.laws.call import LawError
from gridpeers.agents.laws.law import LIMITS, Law, Neighbour, Own, SetPoints, Terms
from gridpeers.wire.driver.machine import POSIX
from gridpeers.wire.plugins.registry import ANYTHING, named

FIRST = 10.0  # Factor on the time limit for the making of a law, or for its first answer, because code is loaded then
BLOCKED = 10.0  # Factor on the time limit for a call in real time, while it waits and does not compute


class _OverError(BaseException):
    """The time is over. It is no Exception, so a law that suppresses every Exception is interrupted too."""


@contextmanager
def limited(what: str, seconds: float, limit: str) -> Iterator[None]:
    """Interrupt the block after some seconds of processor time, and raise LawError.

    In real time the limit is `BLOCKED` times as long: other load on the machine must not decide the result of a run in
    simulated time. SIGALRM interrupts it, in the main thread of a process alone, and not while C code does not return;
    Windows has no such signal. The error names the block by `what`, and the `limit` as a scenario calls it.
    """
    if not POSIX or threading.current_thread() is not threading.main_thread():
        yield
        return
    over = ended = False
    interrupted: BaseException | None = None
    began, last = thread_time(), monotonic() + BLOCKED * seconds

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal over
        if ended:
            return
        left = seconds - (thread_time() - began)
        if left > 0.0 and monotonic() < last:
            signal.setitimer(signal.ITIMER_REAL, max(left, 1e-3))
            return
        over = True
        raise _OverError

    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        signal.setitimer(signal.ITIMER_REAL, seconds)
        try:
            yield
        finally:
            ended = True
            signal.setitimer(signal.ITIMER_REAL, 0.0)
    except BaseException as error:
        if not over:
            raise
        interrupted = error
    finally:
        signal.signal(signal.SIGALRM, before)
    if over:  # also where the law caught the interruption and returned
        raise LawError(f"{what} took longer than {limit}") from interrupted


def make_limited(law: type[Law], parameters: Mapping[str, Any], time_limit: float) -> TimeLimited:
    """Return a law of a class with a time limit on each call; raise ValueError if it cannot be made."""
    seconds = FIRST * time_limit
    try:
        with limited("its __init__", seconds, f"{seconds:g} s, ten times time_limit_s"):
            made = law(**parameters)
        return TimeLimited(made, time_limit)
    except LawError as error:
        raise ValueError(f"cannot be made: {error}") from error
    except ANYTHING as error:  # its __init__ is foreign code
        raise ValueError(f"cannot be made: {named(error)}") from error


class TimeLimited(Law):
    """A law with a time limit (s of processor time) on each call; see `limited`."""

    def __init__(self, law: Law, time_limit: float) -> None:
        super().__init__(**{name: getattr(law, name) for name in LIMITS})
        self.carried, self._time_limit = law, time_limit
        self._limit = f"time_limit_s = {time_limit:g} s"

    def start(self, own: Own) -> None:
        with limited(f"start at t = {own.t:.6g} s", self._time_limit, self._limit):
            self.carried.start(own)

    def step(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> SetPoints | Terms:
        with limited(f"step at t = {own.t:.6g} s", self._time_limit, self._limit):
            return self.carried.step(own, neighbours, T)

    def close(self) -> None:
        """End the law; the run is over, so a failure goes to the log alone."""
        try:
            with limited("it", self._time_limit, self._limit):
                self.carried.close()
        except ANYTHING as error:
            logging.getLogger(__name__).warning("law %s: close failed: %s", type(self.carried).__name__, named(error))
