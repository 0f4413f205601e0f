"""The paper's measures, against forms that everybody can check; and none is called steady that is not."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gridpeers.papers.singhal2022.paper_benchmarks import ISLANDING
from gridpeers.scenarios.measured_run import metrics_json
from gridpeers.scenarios.results import metrics
from gridpeers.scenarios.results.claims import Claim, judge
from gridpeers.scenarios.results.findings import Findings
from gridpeers.scenarios.results.history import Floats, History, Nameplates, Window
from gridpeers.scenarios.results.report import RunReport, plain
from gridpeers.scenarios.results.sharing_index import sharing_index
from gridpeers.scenarios.run_request import Request
from gridpeers.scenarios.schema import load_scenario

PLATES = Nameplates(
    names=("inv1", "inv2", "inv3"),
    GFM=np.array([True, False, False]),
    s=np.array([600e3, 350e3, 350e3]),
    V_nom=np.full(3, 2400.0),
    m_p=np.full(3, 0.01),
    m_q=np.full(3, 0.05),
)
TWO_GFM = replace(PLATES, GFM=np.array([True, True, False]))
TIMES = 0.01 * np.arange(301)
EQUAL, UNEQUAL = [0.5] * 3, [0.5, 0.6, 0.5]


def history(t: Any, f: Any = 60.0, p: Any = 0.5, q: float = 0.1) -> History:
    """Rows of three inverters: f (Hz) for each row, p (pu) for each row or row and inverter, q (pu)."""

    def table(x: Any) -> Floats:
        return np.array(np.broadcast_to(np.reshape(x, (-1, 1)) if np.ndim(x) == 1 else x, (len(t), 3)), float)

    P = table(p) * PLATES.s
    Q, V = np.where(P, q, 0.0) * PLATES.s, table(2400.0)
    return History(inverters=PLATES.names, t=np.array(t, float), f=table(f), P=P, Q=Q, V=V, P_set=P, V_set=V)


def measured(case: History, start: float, end: float, plates: Nameplates = PLATES) -> metrics.Steady:
    """The measures of a window from one time to another (s)."""
    window = Window(label="event1", start=start, end=end)
    with np.errstate(all="ignore"):
        return metrics.measure(window.cut(case), plates, window, 60.0)


powers = st.lists(st.floats(min_value=0.01, max_value=1.0), min_size=3, max_size=3)
droops = st.lists(st.floats(min_value=0.001, max_value=0.1), min_size=3, max_size=3)


@given(x=powers, s=powers, m=droops)
def test_the_sharing_index_is_equation_16_term_by_term(x: list[float], s: list[float], m: list[float]) -> None:
    """The array form equals (16) written as a loop over inverters."""
    eta = sum(x) / sum(s_i / m_i for s_i, m_i in zip(s, m, strict=True))
    total = 0.0
    for x_i, s_i, m_i in zip(x, s, m, strict=True):
        total += abs((m_i * x_i / s_i - eta) / eta)

    index = sharing_index(np.array([x]), np.array(s), np.array(m))

    assert index[0] == pytest.approx(total / 3)


def test_the_paper_s_own_case_II_gives_its_MPSI() -> None:
    """GFM at 1.0 pu, GFL at 0.65 + 0.08 / 0.6 pu: Table I prints 0.12 (nine inverters, section 3)."""
    s = np.array([600e3] * 3 + [350e3] * 6)
    p = np.array([1.0] * 3 + [0.65 + 0.08 / 0.6] * 6)

    assert sharing_index(np.array([p * s]), s, np.full(9, 0.01))[0] == pytest.approx(0.12, abs=0.005)


def test_a_steady_value_is_the_mean_of_the_last_fifth_of_a_second() -> None:
    """Rows before it, and the row at the next event's moment, do not count."""
    t = [round(0.1 * k, 9) for k in range(41)]
    case = history(t, [59.0] * 28 + [59.9, 59.8] + [58.0] * 11)

    assert measured(case, 1.0, 3.0).f_error_Hz == pytest.approx((0.1 + 0.2) / 2)


@pytest.mark.parametrize(("f", "p", "expected"), [
    ([59.9, 60.0, 60.0, 60.0], [EQUAL] * 4, 0.2),
    ([60.0, 59.9, 60.0, 60.0], [EQUAL] * 4, 0.3),
    ([60.0, 60.0, 60.0, 60.0], [UNEQUAL, UNEQUAL, EQUAL, EQUAL], 0.3),
    ([60.0, 60.0, 60.0, 59.98], [EQUAL] * 4, None),
    ([60.0, 60.0, 60.0, 60.0], [EQUAL, EQUAL, EQUAL, UNEQUAL], None),
    ([60.0, 60.0, 60.0, 60.0], [EQUAL] * 4, 0.1),
])  # fmt: skip
def test_restored_means_frequency_and_sharing_both_and_for_good(
    f: list[float], p: list[list[float]], expected: float | None
) -> None:
    """Time counts from the event to the first row from which both hold to the end of the window."""
    case = history([1.0, 1.1, 1.2, 1.3, 1.4], [60.0, *f], [EQUAL, *p])

    assert measured(case, 1.0, 1.4).t_restore_s == expected


def test_every_GFM_must_be_restored() -> None:
    """Two GFM that are off to either side are not restored, though their mean is 60 Hz."""
    case = history([0.0, 1.0, 2.0])
    case.f[:, :2] += [0.05, -0.05]

    steady = measured(case, 1.0, 2.0, TWO_GFM)

    assert steady.t_restore_s is None
    assert steady.f_error_Hz == pytest.approx(0.05)


def test_who_is_off_the_network_is_not_counted() -> None:
    """Rows without inv3 are those of the two others alone: eta, (16), (17), V_error; steady p of it is 0."""
    case = history([1.0, 1.1, 1.2], p=[EQUAL, [0.5, 0.5, 0.0], [0.5, 0.5, 0.0]])
    case.V[1:, 2] = 0.0

    steady = measured(case, 1.0, 1.2)

    assert case.present.tolist() == [[True] * 3, [True, True, False], [True, True, False]]
    for index in (metrics.MPSI, metrics.MQSI, metrics.V_error):
        assert index(case, PLATES) == pytest.approx([0.0] * 3, abs=1e-12)
    assert (steady.p["inv3"], steady.t_restore_s) == (0.0, pytest.approx(0.1))


def test_a_GFM_that_is_off_does_not_hold_back_the_frequency() -> None:
    """The reading of a GFM off the network is no frequency of the island; without a GFM there is none."""
    case = history([0.0, 1.0, 2.0], p=[[0.5, 0.0, 0.5]] * 3)
    case.f[:, 1] = 55.0

    assert measured(case, 0.0, 2.0, TWO_GFM).t_restore_s == 1.0
    case.P[:, 0] = case.Q[:, 0] = 0.0
    assert np.isnan(metrics.mean_frequency(case, TWO_GFM)).all()
    assert measured(case, 0.0, 2.0, TWO_GFM).t_restore_s is None


def test_the_load_is_carried_once_the_total_stays_at_its_steady_value() -> None:
    """The others make up for inv3 in the second row after it left; until then power is missing."""
    case = history([1.0, 1.1, 1.2, 1.3, 1.4])
    case.P[2:, 0] += case.P[0, 2]
    case.P[1:, 2] = 0.0

    assert measured(case, 1.0, 1.4).t_load_s == pytest.approx(0.2)


def test_frequency_and_sharing_are_timed_apart_and_a_swing_is_seen_where_it_is() -> None:
    """The frequency is back after 1.5 s, sharing after 2.5 s; then V of one swings by 0.02 pu, f by 0.004 Hz."""
    t = np.arange(0.0, 10.005, 0.01)
    f = np.where(t < 2.49 + 1e-9, 59.9, 60.0) + 0.002 * np.cos(2.0 * np.pi * t)
    case = history(t, f, np.where(t[:, None] < 3.49 + 1e-9, [0.7, 0.5, 0.5], 0.5))
    case.V[:, 1] *= 1.0 + 0.01 * np.sin(2.0 * np.pi * t)
    window = Window(label="event", start=1.0, end=10.0)

    found = metrics.settling(window.cut(case), PLATES, window, 60.0)

    assert (found.t_f_s, found.t_share_s) == pytest.approx((1.5, 2.5), abs=0.011)
    assert (found.f_swing_Hz, found.V_swing_pu) == pytest.approx((0.004, 0.02), rel=0.01)


@pytest.mark.parametrize(
    ("f", "said"),
    [
        (lambda t: 59.4, ""),
        (lambda t: 60.0 - 0.3 * (t - 2.9), "not steady: still moves -0.3 Hz/s"),
        (lambda t: 60.0 + 0.06 * (t - 2.9), "not steady: still moves +0.06 Hz/s"),
        (lambda t: 60.0 + 0.1 * np.sin(2 * np.pi * 5.0 * t), "not steady: still swings by 0.2 Hz"),
        (lambda t: 60.0 + 0.005 * np.sin(2 * np.pi * 10.0 * t), ""),
        (lambda t: 60.0 - 0.1 * np.exp(-3.0 * (t - 1.0)), ""),
    ],
    ids=["off nominal", "falling", "rising", "swinging", "ripple", "tail of a decay"],
)
def test_a_frequency_that_moves_or_swings_is_not_steady(f: Callable[[Floats], Any], said: str) -> None:
    """Whatever its mean is; a constant one is steady, off nominal too, and so is what nobody could read off a plot."""
    assert measured(history(TIMES, f(TIMES)), 1.0, 3.0).reasons == ({"f_error_Hz": said} if said else {})


@pytest.mark.parametrize(("end", "last", "said"), [
    (1.009, 3.1, "no samples: no row was recorded between 1.001 s and 1.009 s"),
    (1.03, 3.1, "not steady: 2 rows (0.029 s) are too few to tell"),
    (3.0, 2.9, "de-energised: no inverter is on the network in a part of the last 0.2 s"),
    (3.0, 1.5, "de-energised: no inverter is on the network"),
])  # fmt: skip
def test_a_window_that_cannot_be_measured_says_why(end: float, last: float, said: str) -> None:
    """It has no rows, too few, or an island that dies."""
    found = measured(history(TIMES, p=np.where(last > TIMES, 0.6, 0.0)), 1.001, end).reasons

    assert found["V_error"] == said
    assert last != 1.5 or found["f_error_Hz"] == "no leader: no grid-forming inverter is on the network"


def test_powers_that_drift_apart_are_not_steady() -> None:
    """Sharing and powers that move are told, each measure for itself."""
    p = np.full((301, 3), 0.6)
    p[:, 1] += 0.1 * (TIMES - 1.0)
    found = measured(history(TIMES, p=p), 1.0, 3.0).reasons

    assert found["MPSI"].startswith("not steady: still moves +")
    assert found["p"] == "not steady: inv2 still moves +0.1 pu/s"
    assert not {"f_error_Hz", "V_error"} & found.keys()


def test_no_power_to_share_is_told() -> None:
    """Equal sharing of no power, or of what is left of it in an unloaded island, means nothing."""
    found = measured(history(TIMES, p=1e-5 * (-1.0) ** np.arange(301), q=0.0), 1.0, 3.0).reasons

    assert {found["MPSI"], found["MQSI"]} == {"nothing shared: the total is below 0.1% of the ratings"}


def test_a_value_that_is_not_steady_is_no_number_anywhere(tmp_path: Path) -> None:
    """No claim on it passes, no cell shows it, and metrics.json has null and the reason, with the last mean."""
    steady = metrics.Steady(f_error_Hz=0.14, MPSI=0.0, V_error=0.015, MQSI=0.1, t_restore_s=None, p={"inv2": 0.65})
    ramp = replace(steady, reasons={"f_error_Hz": "not steady: still moves -0.3 Hz/s"})
    results = {case: {"event1": steady, "event2": steady} for case in ("II", "III", "IV")}
    found = Findings(results={"I": {"event1": ramp, "event2": steady}, **results}, P_set0=0.65, GFL=("inv2",))
    claim = Claim(
        name="near", text="it is near", source="here", judge=lambda _: (True, "0.14 Hz"),
        measures=("f_error_Hz",), cases=("I",), events=("event1",),
    )  # fmt: skip
    spec, feeder = load_scenario("islanding")
    ran = Request(scenario=spec, feeder=feeder, driver="inprocess", folder=tmp_path)

    (verdict,) = judge(found, [claim])
    text = plain(
        RunReport(scenario="", titles={}, findings=found, verdicts=(), benchmark=ISLANDING, notes=[], folder="x/")
    )
    case = json.loads(metrics_json(ran, found, {case: {} for case in spec.cases}))["cases"]["I"]

    assert verdict.status == "FAIL"
    assert verdict.found == "0.14 Hz, but case I, event1: abs(f-60) not steady: still moves -0.3 Hz/s"
    assert "not steady | 0.14 !" in text
    assert "case I, event1: abs(f-60) not steady: still moves -0.3 Hz/s (mean of the last 0.2 s: 0.140 Hz)" in text
    assert case["event1"]["f_error_Hz"] is None
    assert case["event1"]["reasons"] == {"f_error_Hz": "not steady: still moves -0.3 Hz/s; last mean 0.14 Hz"}
    assert (case["event2"]["f_error_Hz"], "reasons" in case["event2"]) == (0.14, False)
