"""Metrics and claims of one's own: their values, and what becomes of those that fail."""

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from gridpeers.scenarios.results.claims import CLAIMS, Claim, judged
from gridpeers.scenarios.results.findings import Findings
from gridpeers.scenarios.results.history import History, Nameplates, Window, read_only
from gridpeers.scenarios.results.metric import METRICS, measured, metric_of, name_of
from gridpeers.scenarios.results.window_metrics import WindowData
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


@pytest.mark.parametrize(
    ("metric", "said"),
    [
        (
            lambda window: window.history["inv9"]["f"].min(),
            "failed: KeyError: 'inv9'; the inverters are inv1, inv2, their quantities f, P, Q, V, P_set, V_set",
        ),
        (lambda window: window.frequency.min(), "failed: AttributeError: 'WindowData' object has no attribute"),
        (lambda window: float("nan"), "is no finite number: nan"),
        (lambda window: window.f, "returned array("),
        (lambda window: "59.5 Hz", "returned '59.5 Hz'; return a number, or numbers by name"),
        (lambda window: 1 / 0, "failed: ZeroDivisionError: division by zero"),
    ],
)
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


STEADY = Claim(name="steady", text="is steady", source="here", judge=lambda _: (True, "1"), measures=(), cases=("IV",))


def test_a_function_or_a_claim_object_is_judged_and_one_that_raises_fails_in_one_line() -> None:
    """The docstring's first line is the claim; a case that was not run is told."""
    plugins = [Plugin(use=f"{__name__}:{name}") for name in ("holds", "fails", "STEADY", "nothing")]
    verdicts = judged(Findings(results={}), plugins)

    assert [(one.status, one.claim.text) for one in verdicts[:3]] == [
        ("PASS", "Holds always. And this is not part of the claim"),
        ("FAIL", "Needs a case that there is not"),
        ("NOT RUN", "is steady"),
    ]
    assert verdicts[1].found == "cannot be judged: KeyError: 'V'"
    assert 'has no "nothing"' in verdicts[3].found


def spoils(found: Findings) -> bool:
    """Is not true."""
    found.results.clear()  # type: ignore[attr-defined]
    sys.exit(3)


def test_a_claim_ends_no_run_and_changes_no_other_claims_findings() -> None:
    """It may leave Python, or empty what it is given."""
    found = Findings(results={"IV": {}})
    (verdict,) = judged(found, [Plugin(use=f"{__name__}:spoils")])

    assert (verdict.status, verdict.found) == ("FAIL", "cannot be judged: SystemExit: 3")
    assert found.results == {"IV": {}}
