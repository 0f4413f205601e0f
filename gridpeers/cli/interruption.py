"""End a command by a signal as Ctrl-C does; the exit code names the signal."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager

from gridpeers.cli.usage import INTERRUPTED, TERMINATED, fail
from gridpeers.scenarios.results.run_files import TerminatedError
from gridpeers.wire.driver.ending import StopSignal, ctrl_c_or


@contextmanager
def interruptible() -> Iterator[None]:
    """Have SIGTERM, and a terminal that goes away, end what is inside as Ctrl-C does: by `KeyboardInterrupt`.

    Signals within a second are one request, those of Ctrl-C too, which `timeout` passes on twice.
    """
    terminate, numbers = StopSignal(ctrl_c_or(TerminatedError)), [signal.SIGTERM]
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # else a shell has it ignored, or another has it
        numbers.append(signal.SIGINT)
    if signal.getsignal(signal.SIGHUP) is signal.SIG_DFL:  # else nohup has asked that the run outlives its terminal
        numbers.append(signal.SIGHUP)
    before = {number: signal.signal(number, terminate) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def exit_code(error: KeyboardInterrupt) -> int:
    """Return the exit code of a command that a signal ended."""
    return TERMINATED if isinstance(error, TerminatedError) else INTERRUPTED


@contextmanager
def ended_by_signals(left: str) -> Iterator[None]:
    """Do the work of a command; a signal ends it with its exit code, and a line on what is left of the work."""
    try:
        with interruptible():
            yield
    except KeyboardInterrupt as error:
        fail([f"interrupted; {left}"], exit_code(error))
