"""A value is called steady only where it is: ramps, swings, dead islands and empty windows are told as such."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gridpeers.papers.singhal2022.paper_benchmarks import CLAIMS, ISLANDING
from gridpeers.scenarios.measured_run import metrics_json
from gridpeers.scenarios.results.claims import judge
from gridpeers.scenarios.results.findings import Findings
from gridpeers.scenarios.results.history import History, Nameplates, Window
from gridpeers.scenarios.results.metrics import Steady, measure
from gridpeers.scenarios.results.report import RunReport, plain
from gridpeers.scenarios.run_request import Request
from gridpeers.scenarios.schema import load_scenario

PLATES = Nameplates(
    names=("inv1", "inv2"),
    GFM=np.array([True, False]),
    s=np.array([600e3, 350e3]),
    V_nom=np.full(2, 2400.0),
    m_p=np.full(2, 0.01),
    m_q=np.full(2, 0.05),
)
Signal = Callable[[float], float]


def history(
    f: Signal = lambda t: 60.0,
    p: Signal = lambda t: 0.6,
    p_2: Signal | None = None,
    v: Signal = lambda t: 1.0,
    q: float = 0.1,
    end: float = 3.0,
) -> History:
    """Rows of two inverters, 10 ms apart: f (Hz), p (pu, the second's own if given), v and q (pu)."""
    rows = []
    for k in range(round(end / 0.01) + 1):
        t = k * 0.01
        row = [t]
        for i, power in enumerate((p, p_2 or p)):
            row += [f(t), power(t) * PLATES.s[i], q * PLATES.s[i] if power(t) else 0.0, v(t) * 2400.0, 0.0, 2400.0]
        rows.append(row)
    return History.of(PLATES.names, rows)


def reasons(of: History, start: float = 1.0, end: float = 3.0) -> dict[str, str]:
    """Why measures of a window are no steady values."""
    window = Window(label="event1", start=start, end=end)
    with np.errstate(all="ignore"):
        return dict(measure(window.cut(of), PLATES, window, 60.0).reasons)


@pytest.mark.parametrize(
    ("f", "said"),
    [
        (lambda t: 59.4, ""),
        (lambda t: 60.0 - 0.3 * (t - 2.9), "not steady: still moves -0.3 Hz/s"),
        (lambda t: 60.0 + 0.06 * (t - 2.9), "not steady: still moves +0.06 Hz/s"),
        (lambda t: 60.0 + 0.1 * np.sin(2 * np.pi * 5.0 * t), "not steady: still swings by 0.2 Hz"),
    ],
    ids=["off nominal", "falling", "rising", "swinging"],
)
def test_a_frequency_that_moves_or_swings_is_not_steady(f: Signal, said: str) -> None:
    """Whatever its mean is; a constant one is steady, off nominal too."""
    assert reasons(history(f=f)) == ({"f_error_Hz": said} if said else {})


@pytest.mark.parametrize(
    ("end", "last", "said"),
    [
        (1.009, 3.0, "no samples: no row was recorded between 1.001 s and 1.009 s"),
        (1.03, 3.0, "not steady: 2 rows (0.029 s) are too few to tell"),
        (3.0, 2.9, "de-energised: no inverter is on the network in a part of the last 0.2 s"),
    ],
)
def test_a_window_that_cannot_be_measured_says_why(end: float, last: float, said: str) -> None:
    """It has no rows, too few, or an island that dies in its last moment."""
    of = history(p=lambda t: 0.6 if t < last else 0.0)

    assert reasons(of, start=1.001, end=end)["V_error"] == said


def test_a_small_ripple_is_steady() -> None:
    """A ripple of 10 Hz and 5 mHz averages out, and so does the tail of a decay that nobody could read off a plot."""
    assert reasons(history(f=lambda t: 60.0 + 0.005 * np.sin(2 * np.pi * 10.0 * t))) == {}
    assert reasons(history(f=lambda t: 60.0 - 0.1 * np.exp(-3.0 * (t - 1.0)))) == {}


def test_powers_that_drift_apart_are_not_steady() -> None:
    """Sharing and powers that move are told, each measure for itself."""
    found = reasons(history(p_2=lambda t: 0.6 + 0.1 * (t - 1.0)))

    assert found["MPSI"].startswith("not steady: still moves +")
    assert found["p"] == "not steady: inv2 still moves +0.1 pu/s"
    assert "f_error_Hz" not in found
    assert "V_error" not in found


def test_a_dead_island_has_no_values() -> None:
    """Where no inverter is on the network there is no frequency, voltage or share, and the reason says so."""
    found = reasons(history(p=lambda t: 0.6 if t < 1.5 else 0.0))

    assert found["f_error_Hz"] == "no leader: no grid-forming inverter is on the network"
    assert {found[name] for name in ("V_error", "MPSI", "MQSI")} == {"de-energised: no inverter is on the network"}


def test_no_power_to_share_is_told() -> None:
    """Equal sharing of no power, or of what is left of it in an unloaded island, means nothing."""
    found = reasons(history(p=lambda t: 1e-5 if int(t * 100) % 2 else -1e-5, q=0.0))

    assert {found["MPSI"], found["MQSI"]} == {"nothing shared: the total is below 0.1% of the ratings"}


def ramping() -> tuple[Findings, Steady]:
    """The islanding experiment with one frequency that still falls."""
    steady = Steady(f_error_Hz=0.14, MPSI=0.0, V_error=0.015, MQSI=0.1, t_restore_s=None, p={"inv2": 0.65})
    ramp = Steady(
        f_error_Hz=0.14,
        MPSI=0.0,
        V_error=0.015,
        MQSI=0.1,
        t_restore_s=None,
        p={"inv2": 0.65},
        reasons={"f_error_Hz": "not steady: still moves -0.3 Hz/s"},
    )
    results = {case: {"event1": steady, "event2": steady} for case in ("I", "II", "III", "IV")}
    results["I"] = {"event1": ramp, "event2": steady}
    return Findings(results=results, P_set0=0.65, GFL=("inv2",)), ramp


def test_a_claim_on_a_value_that_is_not_steady_does_not_pass() -> None:
    """A number near the paper's is no proof while it still moves: the claim fails, and says why."""
    found, _ = ramping()
    (claim,) = [claim for claim in CLAIMS["islanding"] if claim.name == "table_I_f_error_Hz"]
    loose = Findings(
        results={
            case: {
                event: Steady(
                    f_error_Hz=paper,
                    MPSI=0.0,
                    V_error=0.0,
                    MQSI=0.0,
                    t_restore_s=None,
                    p={},
                    reasons=found.results[case][event].reasons,
                )
                for event, paper in zip(("event1", "event2"), row, strict=True)
            }
            for case, row in {"I": (0.14, 0.07), "II": (0.08, 0.0), "III": (0.08, 0.0), "IV": (0.0, 0.0)}.items()
        }
    )

    (verdict,) = judge(loose, [claim])

    assert verdict.status == "FAIL"
    assert verdict.found.endswith("case I, event1: abs(f-60) not steady: still moves -0.3 Hz/s")


def test_the_report_prints_the_reason_and_not_the_number() -> None:
    """No cell shows a number that is not steady; the reason stands below the table, with the last mean."""
    found, _ = ramping()
    report = RunReport(
        scenario="islanding", titles={}, findings=found, verdicts=(), benchmark=ISLANDING, notes=[], folder="x/"
    )

    text = plain(report)

    assert "not steady | 0.14 !" in text
    assert "case I, event1: abs(f-60) not steady: still moves -0.3 Hz/s (mean of the last 0.2 s: 0.140 Hz)" in text


def test_metrics_json_has_null_and_the_reason(tmp_path: Path) -> None:
    """A program that reads the file meets no number that is not one."""
    found, _ = ramping()
    spec, feeder = load_scenario("islanding")
    ran = Request(scenario=spec, feeder=feeder, driver="inprocess", folder=tmp_path)

    cases = json.loads(metrics_json(ran, found, {case: {} for case in spec.cases}))["cases"]

    assert cases["I"]["event1"]["f_error_Hz"] is None
    assert cases["I"]["event1"]["reasons"] == {"f_error_Hz": "not steady: still moves -0.3 Hz/s; last mean 0.14 Hz"}
    assert cases["I"]["event2"]["f_error_Hz"] == 0.14
    assert "reasons" not in cases["I"]["event2"]
