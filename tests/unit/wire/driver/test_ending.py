"""A process ends once however often it is asked, writes its output to the end, and waits for no thread."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest

from gridpeers.wire.driver.drive import StoppedError
from gridpeers.wire.driver.ending import SAME_REQUEST_TIME, StopSignal, stop_at_signals


def test_what_follows_at_once_is_the_same_request() -> None:
    """`timeout` signals a command and its group: the end of a run is not interrupted by that; a later signal counts."""
    times = [10.0, 10.0, 10.0 + 0.9 * SAME_REQUEST_TIME, 10.0 + SAME_REQUEST_TIME]
    stop = StopSignal(StoppedError, lambda: times.pop(0))

    with pytest.raises(StoppedError, match="SIGTERM"):
        stop(signal.SIGTERM, None)
    stop(signal.SIGTERM, None)
    stop(signal.SIGTERM, None)
    with pytest.raises(StoppedError, match="SIGTERM"):
        stop(signal.SIGTERM, None)


@pytest.mark.parametrize("ignored", [False, True])
def test_ctrl_c_and_sigterm_share_a_handler(ignored: bool) -> None:
    """SIGINT is KeyboardInterrupt with its name, and one that a shell has ignored stays so."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        signal.signal(signal.SIGINT, signal.SIG_IGN if ignored else signal.default_int_handler)
        stop = stop_at_signals(StoppedError)

        assert signal.getsignal(signal.SIGTERM) is stop
        assert signal.getsignal(signal.SIGINT) is (signal.SIG_IGN if ignored else stop)
        with pytest.raises(KeyboardInterrupt, match="SIGINT"):
            stop(signal.SIGINT, None)
        stop(signal.SIGTERM, None)
        assert stop.requests == 1
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def test_a_thread_that_never_ends_does_not_hold_up_the_end() -> None:
    """What is to be done at the end is done, and the exit status is that of the process."""
    script = """
import atexit, threading
from gridpeers.wire.driver.ending import leave
threading.Thread(target=threading.Event().wait).start()
atexit.register(print, "done")
leave(3)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=30.0)

    assert (done.returncode, done.stdout.strip()) == (3, "done")
