"""What the paper says of plug-n-play, a test for each claim."""

import numpy as np
import pytest

from gridpeers.scenarios.results import metrics

from .conftest import Experiment, expected

EVENTS = ("leave", "return")
INV2 = 1


@pytest.mark.parametrize("event", EVENTS)
def test_frequency_and_sharing_are_back_within_a_second(plug_n_play: Experiment, event: str) -> None:
    """Case IV: abs(f-60) < 0.01 Hz and MPSI < 0.01 among those present, for good within 1 s. Section 4, figure."""
    t = plug_n_play.steady["IV"][event].t_restore_s

    assert t is not None
    assert t <= 1.0


def test_the_others_take_its_load_at_once(plug_n_play: Experiment) -> None:
    """In the first row after inverter 2 left, the total power is within 2 % of that before. Section 4, figure of P."""
    history = plug_n_play.histories["IV"]
    before, after = (int(np.searchsorted(history.t, t - 1e-9)) for t in (2.0, 2.01))

    assert history.P[after, INV2] == 0.0
    assert history.P[before, INV2] > 300e3
    assert history.P[after].sum() == pytest.approx(history.P[before].sum(), rel=0.02)


def test_it_comes_back_at_no_load_and_without_a_step(plug_n_play: Experiment) -> None:
    """Inverter 2 gives next to nothing at first; the others go to the new level only, and once they hear of it."""
    history, s = plug_n_play.histories["IV"], plug_n_play.nameplates.s
    k = int(np.searchsorted(history.t, 3.0 - 1e-9))
    others = [i for i in range(9) if i != INV2]
    p_set = history.P_set[:, others] / s[others]
    lowest, level = p_set[k:].min(), p_set[-1].mean()

    assert abs(history.P[k + 1, INV2]) < 0.05 * s[INV2]
    assert np.abs(p_set[k + 2] - p_set[k]).max() < 0.005
    assert lowest > level - 0.02


def test_after_the_return_all_nine_share_alike(plug_n_play: Experiment) -> None:
    """At the end the powers of all nine are equal per unit, as before inverter 2 left. Section 4, figure of P, (9)."""
    p = list(plug_n_play.steady["IV"]["return"].p.values())

    assert max(p) - min(p) < 0.005
    assert p[0] == pytest.approx(plug_n_play.steady["IV"]["islanding"].p["inv1"], abs=0.01)


def test_voltage_returns_likewise(plug_n_play: Experiment) -> None:
    """Case IV: V_error after the return is not above that before the leaving. Section 4, figure of V."""
    steady = plug_n_play.steady["IV"]

    assert steady["return"].V_error <= steady["islanding"].V_error


def test_without_secondary_control_the_returned_inverter_stays_at_no_load(plug_n_play: Experiment) -> None:
    """Case I: nobody tells inverter 2 to take its part again; it is the consensus that does. (7), (12)."""
    steady = plug_n_play.steady["I"]["return"]

    assert abs(steady.p["inv2"]) < 0.01
    assert steady.t_restore_s is None


def test_mean_sharing_is_that_of_eight_while_one_is_away(plug_n_play: Experiment) -> None:
    """MPSI of every row in the last 0.2 s before the return is below 0.001, as the absent one does not count. (16)."""
    history = plug_n_play.histories["IV"]
    away = (history.t > 2.8) & (history.t <= 3.0)

    assert metrics.MPSI(history, plug_n_play.nameplates)[away].max() < 0.001


def test_every_claim_holds(plug_n_play: Experiment) -> None:
    """`gridpeers run plug-n-play` reports what the documentation says. Section 4."""
    assert plug_n_play.statuses("plug-n-play") == expected("plug-n-play")
