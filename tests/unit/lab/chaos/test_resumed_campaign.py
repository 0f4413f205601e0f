"""Campaigns that go on: what they kept is taken up, and what does not fit is refused."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from gridpeers.lab.chaos import campaign as campaigns
from gridpeers.lab.chaos.campaign import Campaign
from gridpeers.lab.chaos.chaos_run import ChaosRow
from gridpeers.lab.chaos.disturbed_scenario import ChaosBase, Disturbance
from gridpeers.scenarios.results.run_files import LOCK, locked
from tests.command_line import invoke
from tests.unit.lab.chaos.bases import base_in
from tests.unit.lab.chaos.small_campaign import rows_of, small

pytestmark = pytest.mark.usefixtures("elsewhere", "few_schedules")


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
