"""Campaigns: a planted bug is found, shrunk, and written as a scenario that shows it; output and errors."""

from __future__ import annotations

import csv
import errno
import json
import os
import re
import shutil
import signal
import tempfile
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from plant.tables.read import DATA
from scenarios.catalogue_files import CATALOGUE
from scenarios.chaos import campaign as campaigns
from scenarios.chaos import chaos_run, schedule_search
from scenarios.chaos.campaign import Campaign, run_campaign
from scenarios.chaos.chaos_folder import ChaosFolder, kept_rows
from scenarios.chaos.chaos_run import ChaosRow, run_scenario
from scenarios.chaos.disturbance import Disturbance, counted_kinds
from scenarios.chaos.machine_error import MachineError
from scenarios.chaos.numbered_run import shrink_number
from scenarios.checks.check_registry import ALWAYS
from scenarios.results.folder_lock import LOCK, locked
from scenarios.results.run_journal import journal_line
from scenarios.run_case import run_case
from scenarios.run_request import BrokenRunError
from scenarios.schema import load_scenario
from tests.chaos.bases import base_in, base_named
from tests.command_line import invoke

pytestmark = pytest.mark.usefixtures("elsewhere")

SMALL = """
name = "small"
without_agent = ["inv2", "inv3", "inv5", "inv6", "inv8", "inv9"]
{extra}

[time]
end_s = 1.2
T_c_s = 0.1
record_s = 0.05

[plant]
load_set = "event2"

[[event]]
label = "islanding"
t_s = 1.0
open = ["13-152", "60-160"]

[case.IV]
secondary = "all"
graph = "full"
"""
"""Three agents that decide ten times a second: a run takes a tenth of a second."""

BREAKS = '''
"""The paper's law, with a bug: who has once used an old value keeps its set-points for ever."""
from agents.laws.consensus import Consensus
import gridpeers as gp


class Breaks(Consensus):
    """It breaks after a cut."""

    broken = False

    def step(self, own, neighbours, T):
        self.broken = self.broken or any(it.age > 0.45 for it in neighbours)
        if self.broken:
            return gp.SetPoints(P_set=0.2, V_set=own.V_set)
        return super().step(own, neighbours, T)
'''


def _small(folder: Path, extra: str = "") -> Path:
    file = folder / "small.toml"
    file.write_text(SMALL.format(extra=extra), encoding="utf-8")
    return file


def test_a_planted_bug_is_found_and_shrunk(elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A law that breaks after a cut: the failure is a file with at most three disturbances, which shows it again."""
    monkeypatch.setattr(schedule_search, "TRIES", 8)
    others = [f'{{ use = "{name}", off = true }}' for name in ALWAYS if name != "frequency"]
    (elsewhere / "breaks.py").write_text(BREAKS, encoding="utf-8")
    base = base_in(_small(elsewhere, f'law = "breaks:Breaks"\nchecks = [{", ".join(others)}]'))
    folder = ChaosFolder(elsewhere, base, 8, "gridpeers chaos small")

    summary = run_campaign(Campaign(base=base, seed=8, runs=3), folder, lambda what, done, of: None)
    (failure,) = summary.failures
    again, _ = load_scenario(failure.file)

    assert failure.violated == "frequency"
    assert 1 <= len(failure.simplest.schedule) <= 3 < len(failure.row.schedule)
    assert f"frequency, run {failure.row.number}: {failure.simplest.violated['frequency']}" in [*summary.lines()]
    assert again == base_in(failure.file).scenario
    assert "frequency" in run_scenario(base_in(failure.file)).violated


def test_a_failure_can_be_moved_with_the_law_check_and_feeder_that_it_names(elsewhere: Path) -> None:
    """No path of this machine is in its file: in another place it loads what stands beside it there."""
    study = elsewhere / "here" / "study"
    shutil.copytree(DATA / "microgrid123", study / "feeder")
    (study / "breaks.py").write_text(f"{BREAKS}\n\ndef calm(case):\n    yield from ()\n", encoding="utf-8")
    text = SMALL.format(extra='law = "breaks:Breaks"\nchecks = ["breaks:calm"]')
    text = text.replace("[plant]\n", '[plant]\nfeeder = "feeder"\n')
    (study / "small.toml").write_text(text, encoding="utf-8")
    row = ChaosRow(number=0, schedule=(), violated={"frequency": "60.1 Hz; too high"})
    base = base_in(study / "small.toml")
    found = elsewhere / "here" / "found"
    found.mkdir()
    file = ChaosFolder(found, base, 8, "gridpeers chaos").write_failure("frequency", row, row)

    kept = [line for line in file.read_text().splitlines() if not line.startswith("#")]
    assert str(elsewhere) not in "\n".join(kept)
    shutil.copytree(elsewhere / "here", elsewhere / "there")
    moved, _ = load_scenario(elsewhere / "there" / file.relative_to(elsewhere / "here"))
    there = str(elsewhere / "there" / "study")
    assert moved.law == {"use": "breaks:Breaks", "folder": there}
    assert {"use": "breaks:calm", "folder": there} in moved.checks
    assert moved.plant.feeder == f"{there}/feeder"


def _rows(folder: Path) -> list[dict[str, str]]:
    with (folder / "chaos.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_the_command_keeps_every_run_with_its_seed_and_schedule(elsewhere: Path) -> None:
    """A line a run, a report, and the same lines again with the same seed."""
    _small(elsewhere)
    words = ("chaos", "small.toml", "--runs", "2", "--seed", "3", "--jobs", "1")

    ended = {name: invoke(*words, "--out", name) for name in ("one", "two")}
    one, two = ([{**row, "took_s": ""} for row in _rows(elsewhere / name)] for name in ("one", "two"))

    assert {code for code, _ in ended.values()} <= {0, 1}
    assert ended["one"][1].startswith("small, case IV: first a run without disturbances ...\n")
    assert "violates nothing; next 2 runs with disturbances, one after another ...\nsmall, 0 of 2" in ended["one"][1]
    assert ended["one"][1].endswith("\n\nResults: one/\n")
    assert [row["seed"] for row in one] == [str(3_000_000 + i) for i in range(2)]
    assert [len(json.loads(row["schedule"])) for row in one] == [int(row["disturbances"]) for row in one]
    assert "repeats" in one[0]["passed"]
    assert one == two
    assert "2 of 2 runs" in (elsewhere / "one" / "report.txt").read_text(encoding="utf-8")


def test_ctrl_c_keeps_what_there_is(elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An interrupted campaign has its runs so far, says how many, and ends with 130."""
    _small(elsewhere)
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
    assert len(_rows(elsewhere / "out")) == 2
    assert "2 of 9 runs" in (elsewhere / "out" / "report.txt").read_text(encoding="utf-8")
    assert (elsewhere / "out" / "status.txt").read_text(encoding="utf-8").startswith("broken: interrupted")


def test_a_full_disk_is_told_and_the_folder_says_broken(elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The command tells the first error, though later files cannot be written either."""

    def full(folder: ChaosFolder, *rest: Any) -> None:
        if len(rest) == 1:
            folder.rows[rest[0].number] = replace(rest[0], violated={"frequency": "too low"})
        if folder.rows:
            raise OSError(errno.ENOSPC, "No space left on device", str(folder.path / "chaos.csv"))

    _small(elsewhere)
    for method in ("add", "write_table", "write_failure"):
        monkeypatch.setattr(ChaosFolder, method, full)
    code, text = invoke("chaos", "small.toml", "--runs", "2", "--jobs", "1", "--out", "out")

    assert code == 3
    assert "chaos.csv: cannot be written: No space left on device" in text
    status = (elsewhere / "out" / "status.txt").read_text(encoding="utf-8")
    assert status.startswith("broken: ")
    assert "No space left on device after 1 of 2 runs" in status


class FullDisk:
    """Runs of cases, of which the machine has no room for the later ones.

    Parameters
    ----------
    whole : int
        Number of runs that it has room for.
    error : OSError
        What it says then.
    """

    def __init__(self, whole: int, error: OSError) -> None:
        self.whole, self._error, self.asked = whole, error, 0

    def __call__(self, *words: Any) -> Any:
        """Run a case, or raise the error."""
        self.asked += 1
        if self.asked > self.whole:
            raise self._error
        return run_case(*words)


NO_SPACE = OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (NO_SPACE, "cannot be written in {tmp} (No space left on device); make room there"),
        (OSError(errno.EFBIG, "File too large"), "cannot be written in {tmp} (File too large); make room there"),
        (OSError(errno.EMFILE, "Too many open files"), "too many files are open: this process may have "),
    ],
)
def test_what_the_machine_lacks_is_no_failure_of_the_scenario(
    error: OSError, told: str, elsewhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The campaign ends with 3, says what and where, keeps its runs, shrinks nothing, leaves no temporary folder."""
    _small(elsewhere)
    (tmp := elsewhere / "tmp").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp))
    monkeypatch.setattr(chaos_run, "run_case", full := FullDisk(3, error))
    code, text = invoke("chaos", "small.toml", "--runs", "9", "--seed", "3", "--jobs", "1", "--out", "out")

    assert code == 3
    assert told.format(tmp=tmp) in text
    assert "2 of 9 runs are kept in out/" in text
    assert full.asked == 4
    assert [row["status"] for row in _rows(elsewhere / "out")] == ["passed", "passed"]
    assert not (elsewhere / "out" / "failures").exists()
    assert (elsewhere / "out" / "status.txt").read_text(encoding="utf-8").startswith("broken: ")
    assert [*tmp.iterdir()] == []


def test_without_room_for_the_first_run_the_scenario_is_not_blamed(
    elsewhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exit code 3, the disk, and no folder."""
    _small(elsewhere)
    monkeypatch.setattr(chaos_run, "run_case", FullDisk(0, NO_SPACE))
    code, text = invoke("chaos", "small.toml", "--runs", "9", "--out", "out")

    assert code == 3
    assert f"cannot be written in {tempfile.gettempdir()} (No space left on device)" in text
    assert "0 of 9 runs are kept and no folder was made" in text
    assert "violated" not in text
    assert not (elsewhere / "out").exists()


def test_a_run_whose_record_ends_early_is_not_judged(elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk that is nearly full ends the record first: checks of messages would find less, and pass."""

    def cut_off(*words: Any) -> Any:
        recorded, outcome = run_case(*words)
        return replace(recorded, record_failure="the record run.mcap ends at 0.50 s: its disk is full"), outcome

    base = base_in(_small(elsewhere))
    monkeypatch.setattr(chaos_run, "run_case", cut_off)

    with pytest.raises(MachineError, match=r"the record run.mcap ends at 0.50 s: its disk is full"):
        run_scenario(base)


def test_without_room_nothing_is_shrunk(elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine without room ends the shrinking of a failure, and does not count as the failure."""
    base = base_in(_small(elsewhere))
    monkeypatch.setattr(chaos_run, "run_case", full := FullDisk(0, NO_SPACE))

    with pytest.raises(MachineError, match="No space left on device"):
        shrink_number(base.text, 8, 3, "frequency", "inprocess")
    assert full.asked == 1


def test_a_signal_in_the_first_run_is_told(elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As later ones: what is kept, and the exit code of the signal."""

    def ended(*words: Any) -> Any:
        signal.raise_signal(signal.SIGTERM)

    _small(elsewhere)
    monkeypatch.setattr(chaos_run, "run_case", ended)
    code, text = invoke("chaos", "small.toml", "--runs", "9", "--out", "out")

    assert code == 143
    assert "interrupted; 0 of 9 runs are kept and no folder was made" in text


def test_workers_that_are_ended_leave_no_folder(elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Theirs are in one of the campaign, which goes with it; those of other campaigns stay."""
    base = base_in(_small(elsewhere))
    (tmp := elsewhere / "tmp").mkdir()
    (others := tmp / "gridpeers-chaos-others").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp))

    def killed(text: str, seed: int, number: int, schedule: Any, driver: str, within: Path) -> Any:
        (within / "gridpeers-chaos-of-worker").mkdir()
        assert within.parent == tmp
        raise KeyboardInterrupt

    monkeypatch.setattr(campaigns, "run_number", killed)
    folder = ChaosFolder(elsewhere, base, 8, "")
    with pytest.raises(KeyboardInterrupt):
        run_campaign(Campaign(base=base, seed=8, runs=3), folder, lambda what, done, of: None)

    assert [*tmp.iterdir()] == [others]


@pytest.mark.parametrize(
    ("out", "said"),
    [
        ("small.toml", "--out small.toml: this is a file; give a new or an empty folder"),
        ("/dev/null", "--out /dev/null: this is a file; give a new or an empty folder"),
        ("small.toml/new/one", "small.toml/new/one: cannot be made or written: Not a directory; give another folder"),
        (".", "--out .: the folder is not empty; give a new or an empty one"),
    ],
)
def test_a_folder_that_cannot_be_used_is_refused_before_the_first_run(
    out: str, said: str, elsewhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exit code 2, and no run is done for nothing."""
    _small(elsewhere)
    monkeypatch.setattr(chaos_run, "run_case", full := FullDisk(0, NO_SPACE))
    code, text = invoke("chaos", "small.toml", "--out", out)

    assert (code, said in " ".join(text.split())) == (2, True), text
    assert full.asked == 0


def test_every_disturbance_is_counted_by_a_noun_of_its_kind() -> None:
    """`KINDS` has a noun for each kind of disturbance that is drawn."""
    base = base_named("plug-n-play")
    schedules = [schedule for batch in range(2) for schedule in schedule_search.drawn(base, 3, batch)]
    kinds = {disturbance.kind for schedule in schedules for disturbance in schedule}

    assert len(kinds) >= 10
    assert re.fullmatch(r"(\d+ [a-z ]+(, |$))+", counted_kinds(schedules))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("nowhere",), 'no scenario "nowhere"'),
        (("islanding", "--case", "V"), '--case: no case "V"'),
        (("islanding", "--case", "I,IV"), "--case: takes one case, got I,IV"),
        (("islanding", "--runs", "0"), "--runs: must be at least 1, got 0"),
        (("islanding", "--seed", "-1"), "--seed: must be at least 0, got -1"),
        (("islanding", "--driver", "many"), 'there is no "many"'),
        (("gridlabd.toml",), "lets nobody leave or join"),
        (("keys.toml", "--driver", "processes"), "needs certificates, which chaos does not take"),
    ],
)
def test_bad_input_is_refused_in_one_line_before_anything_starts(
    words: tuple[str, ...], said: str, elsewhere: Path
) -> None:
    """Exit code 2, the reason, and nothing written."""
    text = (CATALOGUE / "plug-n-play.toml").read_text(encoding="utf-8")
    tables = text.partition("[[event]]")[0] + '[case.I]\nsecondary = "none"\ngraph = "none"\n'
    tables = tables.replace('paper = "plug-n-play"', "")
    (elsewhere / "gridlabd.toml").write_text(tables.replace("[plant]", '[plant]\nsimulator = "gridlabd"'))
    (elsewhere / "keys.toml").write_text(tables.replace("seed = 1", 'seed = 1\nsecurity = "mtls"'))

    code, said_all = invoke("chaos", *words)

    assert code == 2
    assert said in said_all
    assert not (elsewhere / "runs").exists()


def test_a_scenario_that_fails_by_itself_is_refused(elsewhere: Path) -> None:
    """Chaos would find nothing else; the line names the check and a way out."""
    file = _small(elsewhere)
    file.write_text(file.read_text(encoding="utf-8").replace('"all"', '"none"'), encoding="utf-8")

    code, text = invoke("chaos", "small.toml", "--out", "out")

    assert code == 2
    assert "small, case IV: violated without any disturbance: frequency failed" in text
    assert 'switch these checks off in the scenario: checks = [{ use = "frequency", off = true }' in text
    assert not (elsewhere / "out").exists()


def test_an_interrupted_campaign_goes_on(elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With --resume alone it does what is missing of the runs asked for, and the table is that of one go."""
    _small(elsewhere)
    words = ("chaos", "small.toml", "--seed", "3", "--jobs", "1")
    invoke(*words, "--runs", "4", "--out", "whole")
    invoke(*words, "--runs", "2", "--out", "part")
    (elsewhere / "part" / "runs_asked.txt").write_text("4\n", encoding="ascii")  # as if it had been ended after two
    done: list[int] = []
    run_number = campaigns.run_number

    def counted(text: str, seed: int, number: int, *rest: Any) -> Any:
        done.append(number)
        return run_number(text, seed, number, *rest)

    monkeypatch.setattr(campaigns, "run_number", counted)
    code, text = invoke("chaos", "small.toml", "--jobs", "1", "--resume", "part")

    whole, part = ([{**row, "took_s": ""} for row in _rows(elsewhere / name)] for name in ("whole", "part"))
    assert done == [2, 3]
    assert part == whole
    assert (code, text.endswith("\n\nResults: part/\n")) == (0, True)
    assert (elsewhere / "part" / "status.txt").read_text(encoding="utf-8") == "complete\n"


def test_all_that_a_campaign_had_is_there_when_it_goes_on(elsewhere: Path) -> None:
    """Also what runs violated, and the later result of one done twice; half a line, of a kill -9, is left out."""
    folder = ChaosFolder(elsewhere, base_in(_small(elsewhere)), 3, "")
    cut = Disturbance(table="link", entry={"on": "inv1 <-> inv4", "from_s": 0.4, "to_s": 0.7, "cut": True})
    folder.add(ChaosRow(number=0, schedule=()))
    folder.add(ChaosRow(number=0, schedule=(), passed=("ends", "repeats")))
    folder.add(ChaosRow(number=1, schedule=(cut,), violated={"frequency": "60.1 Hz; too high"}, since_s=0.1 + 0.2))
    folder.add(ChaosRow(number=2, schedule=(), collapse="no control prevents it"))
    journal = elsewhere / "runs.jsonl"
    journal.write_text(journal.read_text(encoding="utf-8") + '{"number":3', encoding="utf-8")

    base = base_in(elsewhere / "small.toml")
    assert kept_rows(elsewhere, base, 3, "inprocess", 9) == folder.rows
    assert len(folder.rows) == 3
    assert kept_rows(elsewhere, base, 3, "processes", 9) == {}, "none of them was done with processes"


def test_an_error_that_is_no_utf_8_is_kept(elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its bytes are escapes in the journal, the table and the report, and the campaign goes on with it."""

    def broken(*words: Any) -> Any:
        raise BrokenRunError(os.fsdecode(b"case IV: caf\xe9 ended"))

    base = base_in(_small(elsewhere))
    monkeypatch.setattr(chaos_run, "run_case", broken)
    row = chaos_run.run_schedule(base, (), 3000000)
    (elsewhere / "out").mkdir()
    folder = ChaosFolder(elsewhere / "out", base, 3, "gridpeers chaos small", {0: row}, 1)
    folder.add(row)
    run_campaign(Campaign(base=base, seed=3, runs=1), folder, lambda what, done, of: None)

    assert kept_rows(elsewhere / "out", base, 3, "inprocess", 1) == folder.rows
    assert _rows(elsewhere / "out")[0]["why"] == r"case IV: caf\udce9 ended"
    assert r"ends, run 0: case IV: caf\udce9 ended" in (elsewhere / "out" / "report.txt").read_text(encoding="utf-8")


def test_two_campaigns_never_write_in_one_folder(elsewhere: Path) -> None:
    """While one is at work there, another is refused before it runs anything."""
    base = base_in(_small(elsewhere))
    (elsewhere / "old").mkdir()
    ChaosFolder(elsewhere / "old", base, 3, "").add(ChaosRow(number=0, schedule=()))
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
        (("--resume", "other"), "--resume other: its scenario.toml is not the scenario and case to be disturbed"),
        (("--resume", "bad"), "bad/runs.jsonl:1: this line is damaged ("),
        (("--resume", "before"), "before/runs.jsonl:3: there is no run -1 in any campaign; remove this line"),
        (("--resume", "above"), 'above/runs.jsonl:3: no check is called "../../x": the name of a check has letters,'),
        (("--resume", "odd"), "odd/runs.jsonl:3: its schedule is none that chaos draws (KeyError: 't_s'); remove this"),
        (("--resume", "away"), "away/runs.jsonl:3: its schedule is none that chaos draws (ScenarioError: chaos: event"),
        (("--resume", "below"), "--resume below: its seed.txt is damaged, no campaign has that seed (0 to 1000000000)"),
        (("--resume", "shut"), "--resume shut: Is a directory; a campaign goes on where its folder can be written"),
        (("--resume", "old", "--out", "new"), "--out new: --resume old goes on in that folder; leave one of them out"),
    ],
)
def test_a_campaign_goes_on_only_where_it_was(elsewhere: Path, options: tuple[str, ...], why: str) -> None:
    """One line says what does not fit, before anything is run, and the folder stays as it is."""
    base = base_in(_small(elsewhere))
    for name in ("old", "other", "bad", "before", "above", "odd", "away", "below", "shut"):
        (elsewhere / name).mkdir()
        folder = ChaosFolder(elsewhere / name, base, 3, "")
        folder.add(ChaosRow(number=0, schedule=()))
        folder.add(ChaosRow(number=1, schedule=()))
    (elsewhere / "other" / "scenario.toml").write_text("", encoding="utf-8")
    journal = elsewhere / "bad" / "runs.jsonl"
    journal.write_text(journal.read_text(encoding="utf-8").replace('"number":0', '"number":"many"'), encoding="utf-8")
    timeless = Disturbance(table="event", entry={"leave": ["inv4"]})
    stranger = Disturbance(table="event", entry={"t_s": 0.5, "leave": ["inv99"]})
    for name, row in {
        "before": ChaosRow(number=-1, schedule=()),
        "above": ChaosRow(number=2, schedule=(), violated={"frequency": "low", "../../x": "low"}),
        "odd": ChaosRow(number=2, schedule=(timeless,)),
        "away": ChaosRow(number=2, schedule=(stranger,), violated={"frequency": "low"}),
    }.items():
        with (elsewhere / name / "runs.jsonl").open("ab") as lines:
            lines.write(journal_line(row))
    (elsewhere / "below" / "seed.txt").write_text("-3\n", encoding="ascii")
    (elsewhere / "shut" / LOCK).mkdir()
    before = {file: file.read_bytes() for file in elsewhere.rglob("*") if file.is_file()}

    code, text = invoke("chaos", "small.toml", "--seed", "3", *options)

    after = {file: file.read_bytes() for file in elsewhere.rglob("*") if file.is_file()}
    assert (code, why in " ".join(text.split())) == (2, True), text
    assert {file: text for file, text in after.items() if file.name != LOCK} == before
