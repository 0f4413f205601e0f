"""What the paper accepts in its Remark 2, and what limits of set-points make of it."""

import numpy as np

from .conftest import Experiment, expected

INV2 = 1


def test_without_limits_set_points_grow_as_long_as_power_is_short(wind_up: Experiment) -> None:
    """P_set of GFL 2 grows all through the clouds, beyond twice its rating, while it gives half of it. Remark 2."""
    history, s = wind_up.histories["none"], wind_up.plates.s
    short = (history.t > 3.0) & (history.t < 5.0)

    assert np.all(np.diff(history.P_set[short, INV2][::2]) > 0.0)
    assert history.P_set[short, INV2][-1] > 2.0 * s[INV2]
    assert history.P[short, INV2][-1] < 0.51 * s[INV2]


def test_what_was_wound_up_overshoots_when_power_is_back(wind_up: Experiment) -> None:
    """The frequency goes above nominal by more than twice as much without limits as with them. Remark 2."""
    over = {case: float((h.f[h.t > 5.0][:, wind_up.plates.GFM] - 60.0).max()) for case, h in wind_up.histories.items()}

    assert over["none"] > 2.0 * max(over["clamp"], over["conditional"])


def test_every_claim_holds(wind_up: Experiment) -> None:
    """What `gridpeers run wind-up` says of our run: limits bring f and sharing back sooner. Remark 2."""
    assert wind_up.statuses("wind-up") == expected("wind-up")
