"""What the status of a run folder says when its run ends early."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from gridpeers.scenarios.results.run_files import TerminatedError, broken_if_ended
from gridpeers.wire.driver.ending import READER_GONE, OutputLostError


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (KeyboardInterrupt(), "interrupted from the keyboard"),
        (TerminatedError(), "interrupted by SIGTERM"),
        (ValueError("two\nlines"), "two lines"),
        (ZeroDivisionError(), "ZeroDivisionError"),
        (OSError(errno.ENOSPC, "No space left on device", "out/history.csv"), "out/history.csv: cannot be written: "),
        (OutputLostError(READER_GONE, "nobody reads its output any more"), "nobody reads its output any more"),
    ],
)
def test_the_status_says_why_a_run_ended_early(error: BaseException, told: str, tmp_path: Path) -> None:
    """In one line; the error goes on to whoever has asked for the run."""
    with pytest.raises(type(error)), broken_if_ended(tmp_path):
        raise error

    assert (tmp_path / "status.txt").read_text().startswith(f"broken: {told}")


def test_a_run_that_comes_to_its_end_keeps_its_status(tmp_path: Path) -> None:
    """Nothing is written."""
    with broken_if_ended(tmp_path):
        pass

    assert not list(tmp_path.iterdir())
