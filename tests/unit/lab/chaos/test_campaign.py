"""Campaigns: a planted bug is found, shrunk, and written as a scenario that shows it; output and errors; the corpus."""

from __future__ import annotations

import json
from contextlib import nullcontext
from pathlib import Path

import pytest

from gridpeers.lab.chaos import schedules as schedules_of_chaos
from gridpeers.lab.chaos.campaign import Campaign
from gridpeers.scenarios.catalogue_files import CATALOGUE
from gridpeers.scenarios.checks.check_registry import ALWAYS
from gridpeers.scenarios.schema import load_scenario
from tests.command_line import invoke
from tests.unit.lab.chaos.bases import base_in, run_scenario
from tests.unit.lab.chaos.small_campaign import rows_of, small

pytestmark = pytest.mark.usefixtures("elsewhere")


BREAKS = '''
"""The paper's law, with a bug: who has once used an old value keeps its set-points for ever."""
from gridpeers.agents.laws.consensus import Consensus
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


def test_a_planted_bug_is_found_and_shrunk(elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A law that breaks after a cut: the failure is a file with at most three disturbances, which shows it again."""
    monkeypatch.setattr(schedules_of_chaos, "TRIES", 6)
    others = [f'{{ use = "{name}", off = true }}' for name in ALWAYS if name != "frequency"]
    (elsewhere / "breaks.py").write_text(BREAKS, encoding="utf-8")
    base = base_in(small(elsewhere, f'law = "breaks:Breaks"\nchecks = [{", ".join(others)}]'))
    campaign = Campaign(base=base, seed=8, runs=3, path=elsewhere)
    campaign.begin()

    campaign.run(lambda of: nullcontext(lambda what, done: None))
    ((violated, failure),) = campaign.failures.items()
    again, _ = load_scenario(failure.file)

    assert violated == "frequency"
    assert 1 <= len(failure.simplest.schedule) <= 3 < len(failure.row.schedule)
    assert f"frequency, run {failure.row.number}: {failure.simplest.violated['frequency']}" in [*campaign.lines()]
    assert again == base_in(failure.file).scenario
    assert "frequency" in run_scenario(base_in(failure.file)).violated


@pytest.mark.usefixtures("few_schedules")
def test_the_command_keeps_every_run_with_its_seed_and_schedule(elsewhere: Path) -> None:
    """A line a run, a report, and the same lines again with the same seed."""
    small(elsewhere)
    words = ("chaos", "small.toml", "--runs", "2", "--seed", "3", "--jobs", "1")

    ended = {name: invoke(*words, "--out", name) for name in ("one", "two")}
    one, two = ([{**row, "took_s": ""} for row in rows_of(elsewhere / name)] for name in ("one", "two"))

    assert {code for code, _ in ended.values()} <= {0, 1}
    assert ended["one"][1].startswith("small, case IV: first a run without disturbances ...\n")
    assert "it passes; now 2 runs with disturbances, 1 at a time ...\nsmall, 0 of 2" in ended["one"][1]
    assert ended["one"][1].endswith("\n\nResults: one/\n")
    assert [row["seed"] for row in one] == [str(3_000_000 + i) for i in range(2)]
    assert [len(json.loads(row["schedule"])) for row in one] == [int(row["disturbances"]) for row in one]
    assert "repeats" in one[0]["passed"]
    assert one == two
    assert "2 of 2 runs" in (elsewhere / "one" / "report.txt").read_text(encoding="utf-8")


@pytest.mark.parametrize(("words", "said"), [
    (("nowhere",), 'no scenario "nowhere"'),
    (("islanding", "--case", "V"), '--case: no case "V"'),
    (("islanding", "--case", "I,IV"), "--case: takes one case, got I,IV"),
    (("islanding", "--runs", "0"), "--runs"),
    (("gridlabd.toml",), "lets no inverter leave or join"),
    (("keys.toml", "--driver", "processes"), "needs certificates, and chaos uses no certificates"),
])  # fmt: skip
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
    file = small(elsewhere)
    file.write_text(file.read_text(encoding="utf-8").replace('"all"', '"none"'), encoding="utf-8")

    code, text = invoke("chaos", "small.toml", "--out", "out")

    assert code == 2
    assert "small, case IV: violated without any disturbance: frequency failed" in text
    assert 'switch these checks off in the scenario: checks = [{ use = "frequency", off = true }' in text
    assert not (elsewhere / "out").exists()


CORPUS = Path(__file__).parent / "corpus"

HEAD = "# Violates "
"""Begins the first line of a limit, before words of the sentence with which its check fails."""


@pytest.mark.parametrize("file", sorted((CORPUS / "mended").glob("*.toml")), ids=lambda file: file.stem)
def test_a_mended_failure_passes(file: Path) -> None:
    """The scenario of each failure of the past violates nothing."""
    assert run_scenario(base_in(file)).violated == {}


@pytest.mark.parametrize("name", ["returns-cut", "returns-partition", "var_sharing-kill", "rating-kill-after-lie"])
def test_a_limit_of_the_law_is_still_one(name: str) -> None:
    """The limits that docs/how-to/chaos.md names violate their checks, with the words in their first line."""
    file = CORPUS / "limits" / f"{name}.toml"
    first = file.read_text(encoding="utf-8").partition("\n")[0]
    assert first.startswith(HEAD)

    check = file.stem.partition("-")[0]
    sentence = run_scenario(base_in(file)).violated.get(check, "nothing")

    assert first.removeprefix(HEAD) in sentence, (
        f"{file.stem} does not show its limit any more: it violates {sentence}; "
        "if the law does better now, take it out of the corpus and of docs/how-to/chaos.md"
    )
