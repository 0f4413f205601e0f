"""What the paper says of its islanding experiment, a test for each claim."""

import numpy as np
import pytest

from gridpeers.papers.singhal2022.islanding_claims import EVENTS
from gridpeers.scenarios.results import metrics

from .conftest import Experiment, expected


def test_droop_alone_shares_power_but_not_frequency(islanding: Experiment) -> None:
    """Case I: MPSI is 0 and the frequency stays off, after both events. Table I, (3), (7)."""
    for event in EVENTS:
        steady = islanding.steady["I"][event]
        assert steady.MPSI < 0.001
        assert steady.f_error_Hz > 0.05
        assert steady.t_restore_s is None


def test_only_full_coordination_restores_60_Hz_after_islanding(islanding: Experiment) -> None:
    """After event 1, abs(f-60) is below 0.01 Hz in case IV and in no other. Section 4, Table I."""
    restored = {case for case, events in islanding.steady.items() if events["event1"].f_error_Hz < 0.01}

    assert restored == {"IV"}


@pytest.mark.parametrize("event", EVENTS)
def test_full_coordination_restores_frequency_and_sharing_within_a_second(islanding: Experiment, event: str) -> None:
    """Case IV: abs(f-60) < 0.01 Hz and MPSI < 0.01 for good within 1 s. Section 4, figures of f and MPSI."""
    t = islanding.steady["IV"][event].t_restore_s

    assert t is not None
    assert t <= 1.0


@pytest.mark.parametrize("case", ["II", "III"])
def test_without_the_followers_the_leaders_run_into_their_limit(islanding: Experiment, case: str) -> None:
    """After event 1 every GFM stands at P_max = 1 pu, which is what holds 60 Hz back. Section 4, Table I."""
    p = islanding.steady[case]["event1"].p

    assert [p[name] for name in ("inv1", "inv4", "inv7")] == pytest.approx([1.0] * 3, abs=0.005)


@pytest.mark.parametrize("case", ["II", "III"])
def test_followers_without_consensus_return_to_their_starting_power(islanding: Experiment, case: str) -> None:
    """After event 2 the GFL take no part: their power is P_set of t = 0 again. Section 4, figure of P."""
    p = islanding.steady[case]["event2"].p

    assert [p[name] for name in islanding.found.GFL] == pytest.approx([islanding.found.P_set0] * 6, abs=0.01)


def test_full_coordination_moves_every_inverter_alike(islanding: Experiment) -> None:
    """Case IV: after each event all nine run at the same per-unit power. Section 4, figure of P, (9)."""
    for event in EVENTS:
        p = list(islanding.steady["IV"][event].p.values())
        assert max(p) - min(p) < 0.005


@pytest.mark.parametrize("event", EVENTS)
def test_coordinating_the_leaders_lies_between_none_and_all(islanding: Experiment, event: str) -> None:
    """MQSI: case II is not below case III, and case III is above case IV. Section 4, Table II, (17)."""
    II, III, IV = (islanding.steady[case][event].MQSI for case in ("II", "III", "IV"))

    assert II >= III > IV


@pytest.mark.parametrize("event", EVENTS)
def test_full_coordination_shares_vars(islanding: Experiment, event: str) -> None:
    """Case IV: MQSI is at most 0.1, and at least 5 times below those of cases II and III. Table II, (17)."""
    II, III, IV = (islanding.steady[case][event].MQSI for case in ("II", "III", "IV"))

    assert IV <= 0.1
    assert min(II, III) >= 5.0 * IV


@pytest.mark.parametrize("event", EVENTS)
def test_full_coordination_betters_var_sharing_5_times_over_droop(islanding: Experiment, event: str) -> None:
    """MQSI of case I is more than 5 times that of case IV. Section 4, Table II."""
    assert islanding.steady["I"][event].MQSI > 5.0 * islanding.steady["IV"][event].MQSI


@pytest.mark.parametrize(
    "event",
    [
        "event1",
        pytest.param(
            "event2",
            marks=pytest.mark.xfail(
                reason="with equal vars our feeder keeps 0.0028 pu between its terminals, half of what droop leaves"
            ),
        ),
    ],
)
def test_full_coordination_betters_voltage_5_times_over_droop(islanding: Experiment, event: str) -> None:
    """V_error of case I is more than 5 times that of case IV. Section 4, Table II."""
    assert islanding.steady["I"][event].V_error > 5.0 * islanding.steady["IV"][event].V_error


def test_grid_connected_nothing_moves(islanding: Experiment) -> None:
    """Before event 1 secondary control is on hold: every case starts from the same operating point. Section 4."""
    start = islanding.histories["I"].P[0]
    for history in islanding.histories.values():
        before = history.t < 1.0
        assert np.ptp(history.P_set[before], axis=0).max() == 0.0
        assert np.abs(history.P[before] - start).max() < 1.0
        assert np.abs(history.f[before] - 60.0).max() < 1e-4


def test_the_mean_voltage_returns_to_nominal_with_secondary_control(islanding: Experiment) -> None:
    """At the end mean V is within 0.002 pu of 1 in cases II to IV, and below it in case I. Figure of mean V."""
    mean = {case: float((h.V[-1] / islanding.nameplates.V_nom).mean()) for case, h in islanding.histories.items()}

    assert mean["I"] < 0.996
    assert [mean[case] for case in ("II", "III", "IV")] == pytest.approx([1.0] * 3, abs=0.002)


def test_every_claim_holds_but_for_the_misses_that_are_explained(islanding: Experiment) -> None:
    """The report of `gridpeers run islanding` is the one in the documentation. Section 4, Tables I, II."""
    assert islanding.statuses("islanding") == expected("islanding")


def test_the_indices_fall_to_what_is_left_and_stay_there(islanding: Experiment) -> None:
    """Case IV: MPSI of every row in the last second before event 2 is below 0.001. Figure of MPSI, (16)."""
    history = islanding.histories["IV"]
    last_second = (history.t > 3.0) & (history.t < 4.0)

    assert metrics.MPSI(history, islanding.nameplates)[last_second].max() < 0.001
