"""Campaigns that are interrupted, or have no room: what they have done is kept."""

from __future__ import annotations

import errno
import tempfile
from pathlib import Path
from typing import Any

import pytest

from gridpeers.lab.chaos import campaign as campaigns
from gridpeers.lab.chaos import chaos_run
from gridpeers.scenarios.run import run_case
from tests.command_line import invoke
from tests.unit.lab.chaos.small_campaign import rows_of, small

pytestmark = pytest.mark.usefixtures("elsewhere", "few_schedules")


class FullDisk:
    """Runs of cases, of which the machine has room for some."""

    def __init__(self, whole: int) -> None:
        self.whole, self.asked = whole, 0

    def __call__(self, *words: Any) -> Any:
        self.asked += 1
        if self.asked > self.whole:
            raise NO_SPACE
        return run_case(*words)


NO_SPACE = OSError(errno.ENOSPC, "No space left on device")


def test_ctrl_c_keeps_what_there_is(elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An interrupted campaign has its runs so far, says how many, and ends with 130."""
    small(elsewhere)
    whole = campaigns.run_number

    def interrupted(text: str, seed: int, number: int, *rest: Any) -> Any:
        if number == 2:
            raise KeyboardInterrupt
        return whole(text, seed, number, *rest)

    monkeypatch.setattr(campaigns, "run_number", interrupted)
    code, text = invoke("chaos", "small.toml", "--runs", "9", "--jobs", "1", "--out", "out")

    assert code == 130
    assert text.endswith("interrupted; 2 of 9 runs are kept in out/\n")
    assert len(rows_of(elsewhere / "out")) == 2
    assert "2 of 9 runs" in (elsewhere / "out" / "report.txt").read_text(encoding="utf-8")
    assert (elsewhere / "out" / "status.txt").read_text(encoding="utf-8").startswith("broken: interrupted")


@pytest.mark.parametrize(
    ("whole", "kept"), [(3, "2 of 9 runs are kept in out/"), (0, "0 of 9 runs are kept and no folder was made")]
)
def test_a_run_without_room_ends_the_campaign_and_is_no_failure_of_the_scenario(
    whole: int, kept: str, elsewhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The campaign ends with 3, says what and where, keeps its runs, shrinks nothing, leaves no temporary folder."""
    small(elsewhere)
    (tmp := elsewhere / "tmp").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp))
    monkeypatch.setattr(chaos_run, "run_case", full := FullDisk(whole))
    code, text = invoke("chaos", "small.toml", "--runs", "9", "--seed", "3", "--jobs", "1", "--out", "out")

    assert code == 3
    assert "No space left on device" in text
    assert kept in text
    assert "violated" not in text.partition("now 9 runs")[0]
    assert full.asked == whole + 1
    assert [*tmp.iterdir()] == []
    if whole:
        assert [row["status"] for row in rows_of(elsewhere / "out")] == ["passed", "passed"]
        assert not (elsewhere / "out" / "failures").exists()
        assert (elsewhere / "out" / "status.txt").read_text(encoding="utf-8").startswith("broken: ")
