"""Ctrl-C while a live run already ends: the reason of a record that is cut short."""

from __future__ import annotations

import signal
from types import SimpleNamespace
from typing import Any, cast

import pytest

from gridpeers.scenarios.live.live_processes import UNHEARD, _follow
from gridpeers.scenarios.live.live_recorder import LiveRecorder
from gridpeers.wire.driver.drive import StoppedError
from gridpeers.wire.driver.stop_signal import SAME_REQUEST_TIME, StopSignal, ctrl_c_or


class CutRecorder:
    """A recorder to which the plant's last message never came."""

    def __init__(self) -> None:
        self.cut_short = self.failure = ""
        self.recorded, self.client = None, SimpleNamespace(pacing=None, latest=None)
        self.failed_laws: dict[str, object] = {}

    def __enter__(self) -> CutRecorder:
        return self

    def __exit__(self, *_: object) -> None:
        self.failure = f"the record ends at 9.20 s: {self.cut_short or 'then no word came of the plant'}"


@pytest.mark.parametrize(
    ("later", "why"),
    [
        (0.5 * SAME_REQUEST_TIME, "then no word came of the plant"),
        (SAME_REQUEST_TIME, "SIGINT came again before the plant had ended"),
    ],
)
def test_a_record_that_a_second_ctrl_c_cuts_short_says_so(later: float, why: str) -> None:
    """The plant is not blamed for what the user asked for; a second signal at once is the first one's twin."""
    times = [5.0, 5.0 + later]
    requests = StopSignal(ctrl_c_or(StoppedError), lambda: times.pop(0))

    def run(recorder: Any) -> str:
        try:
            requests(signal.SIGINT, None)
        finally:  # as processes are ended
            requests(signal.SIGINT, None)
        return ""

    outcome = _follow(cast("LiveRecorder", CutRecorder()), run, requests)

    assert (outcome.interrupted, outcome.broke) == ("SIGINT", f"the record ends at 9.20 s: {why}")


def test_a_run_of_which_nothing_was_heard_has_failed() -> None:
    """Its plant ended well by its own account: no link to it was made, so nobody knows what it did."""

    class DeafRecorder(CutRecorder):
        def __exit__(self, *_: object) -> None:
            """End as a recorder that writes no files."""

    outcome = _follow(cast("LiveRecorder", DeafRecorder()), lambda recorder: "", StopSignal(ctrl_c_or(StoppedError)))

    assert outcome.broke == UNHEARD
