"""A process that is asked to end twice at once."""

from __future__ import annotations

import signal

import pytest

from gridpeers.wire.driver.drive import StoppedError
from gridpeers.wire.driver.stop_signal import SAME_REQUEST_TIME, StopSignal, stop_at_signals


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
