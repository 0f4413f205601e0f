"""Campaigns that are interrupted, or lack what they need of the machine, and go on: what they kept is taken up."""

from __future__ import annotations

import errno
import os
import tempfile
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from gridpeers.lab.chaos import campaign as campaigns
from gridpeers.lab.chaos import chaos_run
from gridpeers.lab.chaos.campaign import Campaign, shrink_number
from gridpeers.lab.chaos.chaos_run import ChaosRow, MachineError, run_scenario
from gridpeers.lab.chaos.disturbed_scenario import ChaosBase, Disturbance
from gridpeers.scenarios.results.run_files import LOCK, locked
from gridpeers.scenarios.run import run_case
from tests.command_line import invoke
from tests.unit.lab.chaos.bases import base_in
from tests.unit.lab.chaos.small_campaign import rows_of, small

pytestmark = pytest.mark.usefixtures("elsewhere", "few_schedules")


class FullDisk:
    """Runs of cases, of which the machine has room for some."""

    def __init__(self, whole: int) -> None:
        self.whole, self.asked = whole, 0

    def __call__(self, *words: Any) -> Any:
        """Run a case, or raise the error."""
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
    assert "interrupted; 2 of 9 runs are kept in out/; go on with: gridpeers chaos small.toml --case IV " in text
    assert text.endswith(" --resume out\n")
    assert len(rows_of(elsewhere / "out")) == 2
    assert "2 of 9 runs" in (elsewhere / "out" / "report.txt").read_text(encoding="utf-8")
    assert (elsewhere / "out" / "status.txt").read_text(encoding="utf-8").startswith("broken: interrupted")


def test_a_full_disk_is_told_and_the_folder_says_broken(elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The command tells the first error, though later files cannot be written either."""

    def full(campaign: Campaign, *rest: Any) -> None:
        if len(rest) == 1:
            campaign.rows[rest[0].number] = replace(rest[0], violated={"frequency": "too low"})
        if campaign.rows:
            raise OSError(errno.ENOSPC, "No space left on device", str((campaign.path or elsewhere) / "chaos.csv"))

    small(elsewhere)
    for method in ("add", "write_table", "write_failure"):
        monkeypatch.setattr(Campaign, method, full)
    code, text = invoke("chaos", "small.toml", "--runs", "2", "--jobs", "1", "--out", "out")

    assert code == 3
    assert "chaos.csv: cannot be written: No space left on device" in text
    status = (elsewhere / "out" / "status.txt").read_text(encoding="utf-8")
    assert status.startswith("broken: ")
    assert "No space left on device after 1 of 2 runs" in status


def test_what_the_machine_lacks_is_no_failure_of_the_scenario(elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The campaign ends with 3, says what and where, keeps its runs, shrinks nothing, leaves no temporary folder."""
    small(elsewhere)
    (tmp := elsewhere / "tmp").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp))
    monkeypatch.setattr(chaos_run, "run_case", full := FullDisk(3))
    code, text = invoke("chaos", "small.toml", "--runs", "9", "--seed", "3", "--jobs", "1", "--out", "out")

    assert code == 3
    assert "No space left on device); " in text
    assert f"make room in {tmp}" in text
    assert "2 of 9 runs are kept in out/" in text
    assert full.asked == 4
    assert [row["status"] for row in rows_of(elsewhere / "out")] == ["passed", "passed"]
    assert not (elsewhere / "out" / "failures").exists()
    assert (elsewhere / "out" / "status.txt").read_text(encoding="utf-8").startswith("broken: ")
    assert [*tmp.iterdir()] == []


def test_without_room_for_the_first_run_the_scenario_is_not_blamed(
    elsewhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exit code 3, the disk, and no folder."""
    small(elsewhere)
    monkeypatch.setattr(chaos_run, "run_case", FullDisk(0))
    code, text = invoke("chaos", "small.toml", "--runs", "9", "--out", "out")

    assert code == 3
    assert "No space left on device" in text
    assert "0 of 9 runs are kept and no folder was made" in text
    assert "violated" not in text
    assert not (elsewhere / "out").exists()


def test_a_run_whose_record_ends_early_is_not_judged(elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk that is nearly full ends the record first: checks of messages would find less, and pass."""

    def cut_off(*words: Any) -> Any:
        recorded, outcome = run_case(*words)
        return replace(recorded, record_failure="the record run.mcap ends at 0.50 s: its disk is full"), outcome

    base = base_in(small(elsewhere))
    monkeypatch.setattr(chaos_run, "run_case", cut_off)

    with pytest.raises(MachineError, match=r"the record run.mcap ends at 0.50 s: its disk is full"):
        run_scenario(base)


def test_without_room_nothing_is_shrunk(elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine without room ends the shrinking of a failure, and does not count as the failure."""
    base = base_in(small(elsewhere))
    monkeypatch.setattr(chaos_run, "run_case", full := FullDisk(0))

    with pytest.raises(MachineError, match="No space left on device"):
        shrink_number(base.text, 8, 3, "frequency", "inprocess")
    assert full.asked == 1


# -------------------------------------------------------------------- what goes on


def _begun(folder: Path, base: ChaosBase) -> Campaign:
    campaign = Campaign(base=base, seed=3, runs=9, path=folder)
    campaign.begin()
    return campaign


def test_an_interrupted_campaign_goes_on(elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With --resume alone it does what is missing of the runs asked for, and the table is that of one go."""
    small(elsewhere)
    words = ("chaos", "small.toml", "--seed", "3", "--jobs", "1")
    invoke(*words, "--runs", "4", "--out", "whole")
    invoke(*words, "--runs", "2", "--out", "part")
    (elsewhere / "part" / "asked.json").write_text('{"seed": 3, "runs": 4}')  # as if it had been ended after two
    done: list[int] = []
    run_number = campaigns.run_number

    def counted(text: str, seed: int, number: int, *rest: Any) -> Any:
        done.append(number)
        return run_number(text, seed, number, *rest)

    monkeypatch.setattr(campaigns, "run_number", counted)
    code, text = invoke("chaos", "small.toml", "--jobs", "1", "--resume", "part")

    whole, part = ([{**row, "took_s": ""} for row in rows_of(elsewhere / name)] for name in ("whole", "part"))
    assert done == [2, 3]
    assert part == whole
    assert (code, text.endswith("\n\nResults: part/\n")) == (0, True)
    assert (elsewhere / "part" / "status.txt").read_text(encoding="utf-8") == "complete\n"


def test_all_that_a_campaign_had_is_there_when_it_goes_on(elsewhere: Path) -> None:
    """Also what runs violated, and the later result of one done twice; half a line, of a kill -9, is left out."""
    folder = _begun(elsewhere, base_in(small(elsewhere)))
    cut = Disturbance(table="link", entry={"on": "inv1 <-> inv4", "from_s": 0.4, "to_s": 0.7, "cut": True})
    folder.add(ChaosRow(number=0, schedule=()))
    folder.add(ChaosRow(number=0, schedule=(), passed=("ends", "repeats")))
    folder.add(ChaosRow(number=1, schedule=(cut,), violated={"frequency": "60.1 Hz; too high"}, since_s=0.1 + 0.2))
    folder.add(ChaosRow(number=2, schedule=(), collapse="no control prevents it"))
    journal = elsewhere / "runs.jsonl"
    journal.write_text(journal.read_text(encoding="utf-8") + '{"number":3', encoding="utf-8")

    base = base_in(elsewhere / "small.toml")
    again, others = (
        Campaign(base=base, seed=3, runs=9, path=elsewhere, driver=driver) for driver in ("inprocess", "processes")
    )
    again.take_up()
    others.take_up()
    assert again.rows == folder.rows
    assert len(folder.rows) == 3
    assert others.rows == {}, "none of them was done with processes"


def test_two_campaigns_never_write_in_one_folder(elsewhere: Path) -> None:
    """While one is at work there, another is refused before it runs anything."""
    base = base_in(small(elsewhere))
    (elsewhere / "old").mkdir()
    _begun(elsewhere / "old", base).add(ChaosRow(number=0, schedule=()))
    handle = locked(elsewhere / "old", "--out", "chaos")
    try:
        code, text = invoke("chaos", "small.toml", "--seed", "3", "--resume", "old")
    finally:
        os.close(handle)

    assert (code, text) == (2, "gridpeers: --resume old: another `gridpeers chaos` is at work in it; let it end\n")


@pytest.mark.parametrize(
    ("options", "why"),
    [
        (("--resume", "none"), "--resume none: no folder of a campaign: No such file or directory; name one with"),
        (
            ("--resume", "old", "--seed", "4"),
            "it was begun with --seed 3, not 4; give that one",
        ),
        (("--resume", "old", "--runs", "1"), "--resume old: it has run 1 already; give --runs 2 or more"),
        (("--resume", "other"), "--resume other: its scenario.toml is not the scenario and case to disturb"),
        (("--resume", "bad"), "bad/runs.jsonl:1: this line is damaged ("),
        (
            ("--resume", "below"),
            "--resume below: no folder of a campaign: its asked.json is damaged; name one with",
        ),
        (("--resume", "old", "--out", "new"), "--out new: --resume old goes on in that folder; leave one of them out"),
    ],
)
def test_a_campaign_goes_on_only_where_it_was(elsewhere: Path, options: tuple[str, ...], why: str) -> None:
    """One line says what does not fit, before anything is run, and the folder stays as it is."""
    base = base_in(small(elsewhere))
    for name in ("old", "other", "bad", "below"):
        (elsewhere / name).mkdir()
        folder = _begun(elsewhere / name, base)
        folder.add(ChaosRow(number=0, schedule=()))
        folder.add(ChaosRow(number=1, schedule=()))
    (elsewhere / "other" / "scenario.toml").write_text("", encoding="utf-8")
    journal = elsewhere / "bad" / "runs.jsonl"
    journal.write_text(journal.read_text(encoding="utf-8").replace('"number":0', '"number":"many"'), encoding="utf-8")
    (elsewhere / "below" / "asked.json").write_text("{}\n", encoding="ascii")
    before = {file: file.read_bytes() for file in elsewhere.rglob("*") if file.is_file()}

    code, text = invoke("chaos", "small.toml", "--seed", "3", *options)

    after = {file: file.read_bytes() for file in elsewhere.rglob("*") if file.is_file()}
    assert (code, why in " ".join(text.split())) == (2, True), text
    assert {file: text for file, text in after.items() if file.name != LOCK} == before
