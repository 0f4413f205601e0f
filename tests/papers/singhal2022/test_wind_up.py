"""What the paper accepts in its Remark 2, and what limits of set-points make of it."""

import numpy as np
import pytest
from msgspec.structs import replace

from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.results.history import History
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.configs import configs
from gridpeers.wire.messages import Telemetry

from .conftest import Experiment, expected

INV1, INV2 = 0, 1


def overshoot(history: History, experiment: Experiment) -> float:
    """How far the frequency goes above nominal after the sun is back (Hz)."""
    return float((history.f[history.t > 5.0][:, experiment.nameplates.GFM] - 60.0).max())


def test_without_limits_set_points_grow_as_long_as_power_is_short(wind_up: Experiment) -> None:
    """P_set of GFM 1 grows all through the clouds, beyond twice its rating, while it gives half of that. Remark 2."""
    history, s = wind_up.histories["none"], wind_up.nameplates.s
    short = (history.t > 3.0) & (history.t < 5.0)

    assert np.all(np.diff(history.P_set[short, INV1][::2]) > 0.0)
    assert history.P_set[short, INV1][-1] > 2.0 * s[INV1]
    assert history.P[short, INV1][-1] < 1.1 * s[INV1]


def test_a_gfl_holds_its_rating_when_it_is_told_more(wind_up: Experiment) -> None:
    """Its agent winds up as the others do, but GFL 2 clips P_set in place, as GridLAB-D does; it gives half of it."""
    history, s = wind_up.histories["none"], wind_up.nameplates.s
    wound = (history.t > 4.0) & (history.t < 5.0)

    assert np.all(history.P_set[wound, INV2] == s[INV2])
    assert history.P[wound, INV2][-1] < 0.51 * s[INV2]


def test_what_was_wound_up_overshoots_when_power_is_back(wind_up: Experiment) -> None:
    """The frequency goes above nominal by a third more without limits than with them. Remark 2."""
    over = {case: overshoot(history, wind_up) for case, history in wind_up.histories.items()}

    assert over["none"] > 1.3 * max(over["clamp"], over["conditional"])


def test_a_reference_that_is_not_clipped_overshoots_three_times_as_far(wind_up: Experiment) -> None:
    """The clipping decides: with a bound of 3 pu for GFL too, the frequency goes to 60.38 Hz instead of 60.12 Hz."""
    scenario, feeder = load_scenario("wind-up")
    plant = replace(scenario.plant, gfl=replace(scenario.plant.gfl, P_set_lim=3.0))
    rows: list[tuple[float, ...]] = []

    def take(telemetry: Telemetry) -> None:
        rows.extend(telemetry.rows)

    run_inprocess(*configs(replace(scenario, plant=plant), feeder, "none"), take)

    assert overshoot(History.of(wind_up.nameplates.names, rows), wind_up) == pytest.approx(0.384, abs=0.005)
    assert overshoot(wind_up.histories["none"], wind_up) == pytest.approx(0.121, abs=0.005)


def test_every_claim_holds(wind_up: Experiment) -> None:
    """`gridpeers run wind-up` reports that limits bring f and sharing back sooner. Remark 2."""
    assert wind_up.statuses("wind-up") == expected("wind-up")
