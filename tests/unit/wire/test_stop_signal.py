"""A process that is asked to end twice at once."""

from __future__ import annotations

import signal

import pytest

from wire.driver.drive import StoppedError
from wire.driver.stop_signal import SAME_REQUEST_TIME, StopSignal


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
