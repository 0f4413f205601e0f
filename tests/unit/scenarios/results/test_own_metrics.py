"""Metrics, claims and benchmarks of one's own: what they give, and what becomes of those that fail."""

import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gridpeers.scenarios.catalogue_files import CATALOGUE
from gridpeers.scenarios.results.claims import (
    BENCHMARKS,
    CLAIMS,
    NO_BENCHMARK,
    Benchmark,
    Claim,
    benchmark_of,
    claim_of,
    judge,
)
from gridpeers.scenarios.results.findings import Findings
from gridpeers.scenarios.results.history import History, Nameplates, Window, read_only
from gridpeers.scenarios.results.metric import METRICS, measured, metric_of, name_of
from gridpeers.scenarios.results.metrics import Steady
from gridpeers.scenarios.results.report import RunReport, plain
from gridpeers.scenarios.results.window_metrics import WindowData
from gridpeers.scenarios.schema import ScenarioError, load_scenario
from gridpeers.scenarios.schema.loading import check_tables
from gridpeers.scenarios.schema.scenario_errors import Problems
from gridpeers.scenarios.schema.scenario_writing import to_toml
from gridpeers.wire.plugins.plugin import Plugin, plugin_problems
from gridpeers.wire.plugins.registry import PluginError

NAMES = ("inv1", "inv2")


def window_data() -> WindowData:
    """Two inverters, one a GFM whose frequency dips to 59.5 Hz right after the event."""
    t = np.round(np.arange(0.0, 2.005, 0.01), 9)
    f = np.where((t > 1.0) & (t < 1.1), 59.5, 60.0)[:, None] + np.array([0.0, -1.0])
    ones = np.ones((len(t), 2))
    whole = read_only(
        History(inverters=NAMES, t=t, f=f, P=5e5 * ones, Q=1e4 * ones, V=277.0 * ones, P_set=ones, V_set=ones)
    )
    nameplates = Nameplates(
        names=NAMES,
        GFM=np.array([True, False]),
        s=np.array([1e6, 1e6]),
        V_nom=np.array([277.0, 277.0]),
        m_p=np.array([0.01, 0.01]),
        m_q=np.array([0.05, 0.05]),
    )
    event = Window(label="event1", start=1.0, end=2.0)
    return WindowData.cut(whole, event, case="IV", nameplates=nameplates, f_nom=60.0, T_c=0.02)


def of(metric: Callable[[WindowData], Any]) -> tuple[dict[str, float | None], dict[str, str]]:
    """Value of a metric called "mine"."""
    found = measured([("mine", metric)], window_data())
    return dict(found.values), dict(found.reasons)


def test_a_metric_gets_the_windows_rows_as_arrays_and_as_a_table() -> None:
    """Rows between the events, columns by inverter; numbers of numpy and pandas are numbers."""
    assert of(lambda window: window.f[:, window.nameplates.GFM].min()) == ({"mine": 59.5}, {})
    assert of(lambda window: window.history["inv1"]["f"].min()) == ({"mine": 59.5}, {})
    assert of(lambda window: len(window.t)) == ({"mine": 100.0}, {})
    assert of(lambda window: {"low": window.f.min(), "high": True}) == ({"mine.low": 58.5, "mine.high": 1.0}, {})
    assert of(lambda window: None) == ({"mine": None}, {})


@pytest.mark.parametrize(("metric", "said"), [
    (
        lambda window: window.history["inv9"]["f"].min(),
        "failed: KeyError: 'inv9'; the inverters are inv1, inv2, their quantities f, P, Q, V, P_set, V_set",
    ),
    (lambda window: window.frequency.min(), "failed: AttributeError: 'WindowData' object has no attribute"),
    (lambda window: float("nan"), "is no finite number: nan"),
    (lambda window: window.f, "returned array("),
    (lambda window: "59.5 Hz", "returned '59.5 Hz'; return a number, or numbers by name"),
    (lambda window: 1 / 0, "failed: ZeroDivisionError: division by zero"),
])  # fmt: skip
def test_a_metric_that_fails_is_null_and_says_why_in_one_line(metric: Callable[[Any], Any], said: str) -> None:
    """It harms no other metric and no run."""
    values, reasons = of(metric)

    assert values == {"mine": None}
    assert reasons["mine"].startswith(said)
    assert "\n" not in reasons["mine"]


def test_gridpeers_own_metrics_are_entries_like_any_other() -> None:
    """Each has a sentence, and gives what metrics.json has."""
    data = window_data()
    plugins = [(name, Plugin(use=name)) for name in METRICS.names if ":" not in name and name in METRICS.names[:16]]
    values = measured([(name, metric_of(plugin)) for name, plugin in plugins], data).values

    assert all(METRICS.resolve(name).__doc__ for name, _ in plugins)
    assert values["MPSI"] == data.steady.MPSI
    assert values["p.inv1"] == 0.5
    assert len(plugins) == 16


def test_what_is_no_metric_and_no_claim_is_refused() -> None:
    """One line with what would be right; a name of ours is never taken over."""
    (wrong,) = plugin_problems(METRICS, Plugin(use="math:pi"))
    (other,) = plugin_problems(CLAIMS, Plugin(use="math:pi"))

    assert wrong[1] == (
        "math:pi is no metric: write a function of the window, or a class with a method __call__(self, window)"
    )
    assert "is no claim: write a function of the findings" in other[1]
    assert "called with one argument" in plugin_problems(METRICS, Plugin(use="shutil:copyfileobj"))[0][1]
    with pytest.raises(PluginError, match='there is a metric "MPSI" already'):
        METRICS.register("MPSI")(lambda window: 0.0)
    assert name_of(Plugin(use="mine.more:nadir_Hz")) == "nadir_Hz"


def holds(found: Findings) -> tuple[bool, str]:
    """Holds always. And this is not part of the claim.

    Nor is this.
    """
    return True, "as it is"


def fails(found: Findings) -> bool:
    """Needs a case that there is not."""
    return found.results["V"]["event1"].MPSI < 0.1


def ends(found: Findings) -> bool:
    """Is not true."""
    sys.exit(3)


STEADY = Claim(name="steady", text="is steady", source="here", judge=lambda _: (True, "1"), measures=(), cases=("IV",))


def test_a_function_or_a_claim_object_is_judged_and_one_that_raises_fails_in_one_line() -> None:
    """The docstring's first line is the claim; one that was not run is told; leaving Python ends no run."""
    plugins = [Plugin(use=f"{__name__}:{name}") for name in ("holds", "fails", "STEADY", "nothing", "ends")]
    verdicts = judge(Findings(results={}), [*map(claim_of, plugins)])
    (known,) = judge(FOUND, [claim_of(plugins[1])])

    assert [(one.status, one.claim.text) for one in verdicts[:3]] == [
        ("PASS", "Holds always. And this is not part of the claim"),
        ("FAIL", "Needs a case that there is not"),
        ("NOT RUN", "is steady"),
    ]
    assert verdicts[1].found == "cannot be judged: KeyError: 'V'"
    assert 'has no "nothing"' in verdicts[3].found
    assert (verdicts[4].status, verdicts[4].found) == ("FAIL", "cannot be judged: SystemExit: 3")
    assert known.found == "cannot be judged: KeyError: 'V'; cases and events are IV, event1"


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

FOUND = Findings(
    results={"IV": {"event1": Steady(f_error_Hz=0.0, MPSI=0.09, V_error=0.0, MQSI=0.0, t_restore_s=None, p={})}}
)


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
    verdicts = judge(FOUND, benchmark.claims)
    text = plain(
        RunReport(scenario="", titles={}, findings=FOUND, verdicts=verdicts, benchmark=benchmark, notes=[], folder="x/")
    )

    assert "ours | paper's Table 7" in text
    assert "0.090 | 0.05 !" in text
    assert "1 of 1 claims of the paper hold\nnothing more to say\n" in text


@pytest.mark.parametrize(("paper", "said"), [
    ("my_benchmark:MINES", 'my_benchmark:MINES: module my_benchmark has no "MINES"; did you mean "MINE"?'),
    ("my_benchmark:OTHER", "my_benchmark:OTHER is no benchmark: it is no gridpeers.Benchmark"),
    ("no_such_module:MINE", 'no_such_module:MINE: there is no module "no_such_module"'),
    ("island", 'paper: there is no benchmark "island"; did you mean "islanding"?'),
])  # fmt: skip
def test_a_benchmark_that_is_none_is_told_before_anything_runs(tmp_path: Path, paper: str, said: str) -> None:
    """One line with its key, what is wrong, and what would be right."""
    with pytest.raises(ScenarioError) as error:
        load_scenario(scenario(tmp_path, paper))

    assert len(error.value.problems) == 1
    assert said in error.value.problems[0]


def test_a_benchmark_that_raises_fails_not_the_run() -> None:
    """A summary is anybody's code: the report says what went wrong in it."""
    broken = Benchmark(summary=lambda found: [found.no_such_thing])  # type: ignore[attr-defined]
    verdicts = judge(FOUND, (STEADY,))

    text = plain(
        RunReport(scenario="", titles={}, findings=FOUND, verdicts=verdicts, benchmark=broken, notes=[], folder="x/")
    )

    assert "The benchmark's summary failed: AttributeError" in text


def test_every_benchmark_of_the_catalogue_is_there() -> None:
    """A name that a scenario may write leads to numbers or claims; no name leads to none."""
    for name in BENCHMARKS.names:
        assert benchmark_of(name).claims
    assert benchmark_of("") is NO_BENCHMARK
