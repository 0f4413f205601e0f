"""Benchmarks: what is published of an experiment, added from outside."""

import tomllib
from functools import partial
from pathlib import Path

import pytest

from gridpeers.scenarios.catalogue_files import CATALOGUE
from gridpeers.scenarios.results.claims import (
    BENCHMARKS,
    NO_BENCHMARK,
    Benchmark,
    Claim,
    benchmark_of,
    judge,
)
from gridpeers.scenarios.results.findings import Findings
from gridpeers.scenarios.results.metrics import Steady
from gridpeers.scenarios.results.report import RunReport, plain
from gridpeers.scenarios.schema import ScenarioError, load_scenario
from gridpeers.scenarios.schema.loading import check_tables
from gridpeers.scenarios.schema.scenario_errors import Problems
from gridpeers.scenarios.schema.scenario_writing import to_toml

MODULE = """
from gridpeers.scenarios.results.claims import Benchmark
from gridpeers.scenarios.results.claims import Claim
from gridpeers.scenarios.results.claims import Published

PLACE = {"case": "IV", "event": "event1", "quantity": "MPSI"}
MINE = Benchmark(
    numbers=(Published(source="Table 7", **PLACE, paper=0.05, digits=2, limit=0.02),),
    claims=(
        Claim(
            name="small", text="MPSI is small", source="page 3", measures=("MPSI",), cases=("IV",), events=("event1",),
            judge=lambda found: (found.results["IV"]["event1"].MPSI < 0.1, "it is"),
        ),
    ),
    summary=lambda found: ["nothing more to say"],
)
OTHER = 3
"""


def scenario(folder: Path, paper: str) -> Path:
    """The islanding with another benchmark, in a folder that has a module beside it."""
    (folder / "my_benchmark.py").write_text(MODULE, encoding="utf-8")
    text = (
        (CATALOGUE / "islanding.toml").read_text(encoding="utf-8").replace('paper = "islanding"', f'paper = "{paper}"')
    )
    (folder / "mine.toml").write_text(text, encoding="utf-8")
    return folder / "mine.toml"


def test_a_users_benchmark_stands_beside_ours_and_judges(tmp_path: Path) -> None:
    """Its number is in the table with its source, its claim has a verdict, its summary follows."""
    spec, _ = load_scenario(scenario(tmp_path, "my_benchmark:MINE"))
    benchmark = benchmark_of(spec.paper)
    again, _ = check_tables(tomllib.loads(to_toml(spec, {})), tmp_path / "elsewhere" / "again.toml", Problems("again"))
    assert again.paper == {"use": "my_benchmark:MINE", "folder": str(tmp_path)}
    steady = Steady(f_error_Hz=0.0, MPSI=0.09, V_error=0.0, MQSI=0.0, t_restore_s=None, p={})
    found = Findings(results={"IV": {"event1": steady}})
    verdicts = judge(found, benchmark.claims)
    text = plain(
        RunReport(scenario="", titles={}, findings=found, verdicts=verdicts, benchmark=benchmark, notes=[], folder="x/")
    )

    assert "ours | paper's Table 7" in text
    assert "0.090 | 0.05 !" in text
    assert "1 of 1 claims hold.\nnothing more to say\n" in text


@pytest.mark.parametrize(
    ("paper", "said"),
    [
        ("my_benchmark:MINES", 'my_benchmark:MINES: module my_benchmark has no "MINES"; did you mean "MINE"?'),
        ("my_benchmark:OTHER", "my_benchmark:OTHER is no benchmark: it is no gridpeers.Benchmark"),
        ("no_such_module:MINE", 'no_such_module:MINE: there is no module "no_such_module"'),
        ("island", 'paper: there is no benchmark "island"; did you mean "islanding"?'),
    ],
)
def test_a_benchmark_that_is_none_is_told_before_anything_runs(tmp_path: Path, paper: str, said: str) -> None:
    """One line with its key, what is wrong, and what would be right."""
    with pytest.raises(ScenarioError) as error:
        load_scenario(scenario(tmp_path, paper))

    assert len(error.value.problems) == 1
    assert said in error.value.problems[0]


def test_a_benchmark_that_raises_fails_its_claim_and_not_the_run() -> None:
    """A claim and a summary are anybody's code: the report says what went wrong in them."""
    odd = partial(Claim, name="odd", text="it is odd", source="", measures=())
    claim = odd(judge=lambda found: (found.results["V"] is None, ""))
    broken = Benchmark(claims=(claim,), summary=lambda found: [found.no_such_thing])  # type: ignore[attr-defined]
    found = Findings(results={"IV": {}})
    verdicts = judge(found, broken.claims)
    report = RunReport(
        scenario="", titles={}, findings=found, verdicts=verdicts, benchmark=broken, notes=[], folder="x/"
    )

    (verdict,) = verdicts
    assert (verdict.status, verdict.found) == ("FAIL", "cannot be judged: KeyError: 'V'; cases and events are IV")
    assert "The benchmark's summary failed: AttributeError" in plain(report)


def test_every_benchmark_of_the_catalogue_is_there() -> None:
    """A name that a scenario may write leads to numbers or claims; no name leads to none."""
    for name in BENCHMARKS.names:
        assert benchmark_of(name).claims
    assert benchmark_of("") is NO_BENCHMARK
