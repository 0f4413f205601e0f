"""Checklist row 25: GridLAB-D's autotest trajectory."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace

from bench.validation.gfm_gfl import GFL, Z_LOAD4, gfm_gfl_circuit, gfm_gfl_dynamics

# t label (s): published P_A (W, loose initial convergence), tight P_A (W), tight f (Hz)
TRAJECTORY = {
    1.998: (24909.548, 24909.9569, 60.000000),
    2.000: (18218.671, 18219.0150, 60.008506),
    2.002: (15504.233, 15504.5472, 60.021391),
    2.004: (15071.898, 15072.2062, 60.033217),
    2.010: (15805.222, 15805.5334, 60.055823),
    2.050: (18802.015, 18802.3537, 60.060449),
    2.100: (20392.212, 20392.5575, 60.041785),
    2.500: (20878.637, 20878.9972, 60.036479),
    3.998: (21394.433, 21394.8031, 60.031639),
    4.000: (40048.890, 40049.4402, 60.006807),
    4.002: (48005.545, 48006.2175, 59.970778),
    4.010: (50940.210, 50940.8706, 59.859600),
    4.050: (46489.614, 46490.2167, 59.799364),
    4.200: (40554.767, 40555.2978, 59.857709),
    5.000: (34750.466, 34750.9313, 59.911325),
    5.998: (34518.428, 34518.9139, 59.913502),
}


def test_the_autotest_starts_where_gridlabd_starts() -> None:
    """Row 25: initial power, P_set and V_set are those of GridLAB-D with tight tolerances."""
    units = gfm_gfl_dynamics().inverters

    S = units.V[0] * np.conj(units.J[0] - units.y_f[0] * units.V[0])

    assert S.sum() == pytest.approx(74724.351 - 9147.850j, abs=1e-3)
    assert S.real == pytest.approx([24909.957, 24907.197, 24907.197], abs=1e-3)
    assert units.set_points[0, 0] == pytest.approx(0.3736217572, abs=1e-10)
    assert units.set_points[0, 1] == pytest.approx(0.9976983563, abs=1e-10)


def test_the_autotest_trajectory_is_gridlabds() -> None:
    """Row 25: power of phase A and frequency follow GridLAB-D through two load steps, to 1e-4 W and 1e-6 Hz."""
    plant = gfm_gfl_dynamics()
    units = plant.inverters
    seen = {}
    first_solution = None
    for step in range(999, 3000):
        t = round(step * plant.h, 3)
        if t == 2.0:
            plant.connect(gfm_gfl_circuit(Z_LOAD4[1]))
            first_solution = (units.V[0, 0] * np.conj(units.J[0, 0] - units.y_f[0] * units.V[0, 0])).real
        elif t == 4.0:
            plant.connect(gfm_gfl_circuit(Z_LOAD4[2]))
        f = plant.run(1)[0, 0, 0]
        seen[t] = ((units.V[0, 0] * np.conj(units.I[0, 0])).real, f)

    for t, (published, tight, f) in TRAJECTORY.items():
        assert seen[t][0] == pytest.approx(tight, abs=1e-4), f"P_A at label {t}"
        assert seen[t][0] == pytest.approx(published, abs=1.0), f"published P_A at label {t}"
        assert seen[t][1] == pytest.approx(f, abs=1e-6), f"f at label {t}"
    assert first_solution == pytest.approx(21474.649, abs=1e-3), "the true electrical jump"


def test_both_representations_of_the_gfl_settle_alike() -> None:
    """The current source and the voltage source differ in the first milliseconds, not in where they end."""
    ends = []
    for model in ("voltage_source", "current_source"):
        plant = gfm_gfl_dynamics(replace(GFL, model=model))
        plant.connect(gfm_gfl_circuit(Z_LOAD4[1]))
        ends.append(plant.run(5000)[-1])

    assert ends[0][:, 1:3] == pytest.approx(ends[1][:, 1:3], abs=0.1)
    assert ends[0][:, 0] == pytest.approx(ends[1][:, 0], abs=1e-6)
