"""Checklist rows 1 and 3 to 13: the grid-forming inverter."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace
from numpy.typing import NDArray

from gridpeers.plant.dynamics.kernel import gfm
from tests.unit.plant.dynamics.circuits import GFM_A, GFM_D, S_B, V_B, Z_B, loaded, lone, on_stiff_bus, pair

Series = NDArray[np.float64]


def crossing(y: Series, level: float, h: float) -> float:
    """Time (s) at which y first passes level, the first sample at label 0."""
    k = int(np.argmax(y >= level))
    return float((k - (y[k] - level) / (y[k] - y[k - 1])) * h)


def settled(y: Series, end: float, within: float, h: float) -> float:
    """Time (s) from which y stays within +-within of end."""
    return float((np.flatnonzero(np.abs(y - end) > within)[-1] + 1) * h)


def test_bases() -> None:
    """Row 1: 200 kVA at 277.1363 V has 1.15207 ohm, and the autotest's filter 0.4507 - j5.2672 S."""
    record = gfm.pack(GFM_A, S_B, V_B, 0.01, 0.05, 60.0)

    assert pytest.approx(240.56, rel=1e-4) == S_B / (3.0 * V_B)
    assert pytest.approx(1.15207, rel=1e-4) == Z_B
    assert complex(record["y_f"]) == pytest.approx(0.4507 - 5.2672j, rel=1e-4)


def test_a_lone_gfm_droops() -> None:
    """Rows 3 and 4: a step of 0.5 pu ends 0.3 Hz lower, on the way a first-order lag of 10 ms."""
    plant = lone(GFM_D, 0.3)
    plant.inverters.set_points[0, 0] = 0.3
    plant.connect(loaded(0.3))
    plant.run(500)
    plant.connect(loaded(0.8))

    f = plant.run(2500)[:, 0, 0]

    assert [f[5], f[10], f[25]] == pytest.approx([59.796, 59.742, 59.710], abs=0.003)
    assert f[-1] == pytest.approx(59.7000, abs=0.001)
    assert plant.readings()[0, 3] / V_B == pytest.approx(plant.inverters.set_points[0, 1], abs=1e-4)


def test_the_voltage_controller_alone() -> None:
    """Row 5: without load the measured voltage follows V_set with poles -6.25 and -93.7 1/s."""
    plant = lone(GFM_D, 0.0)
    plant.inverters.set_points[0, 1] += 0.01

    s1, s2 = 6.25, 93.7
    for k in range(1, 51):
        plant.run(10)
        t = 10 * k * plant.h
        expected = 0.01 * (1.0 - (s2 * np.exp(-s1 * t) - s1 * np.exp(-s2 * t)) / (s2 - s1))
        assert plant.inverters.gfm_state["v"][0] - 1.0 == pytest.approx(expected, abs=0.02 * 0.01)


def test_voltage_droop_on_a_stiff_bus() -> None:
    """Row 6: 1 % of V_set is 0.2 pu of var, 63 % of it after 0.548 s."""
    plant = on_stiff_bus(GFM_A)
    plant.inverters.set_points[0, 1] += 0.01

    q = plant.run(3000)[:, 0, 2] / S_B

    assert q[-1] == pytest.approx(0.200, rel=0.02)
    assert crossing(q, 0.2 * (1.0 - np.exp(-1.0)), plant.h) == pytest.approx(0.548, rel=0.02)


def test_power_step_on_a_stiff_bus() -> None:
    """Row 7: P_set acts at once on the speed; power follows in 25 ms to a half and 75 ms to 90 %, without overshoot."""
    plant = on_stiff_bus(GFM_A)
    plant.inverters.set_points[0, 0] = 0.3

    out = plant.run(1000)[:, 0]
    p = out[:, 1] / S_B

    assert out[0, 0] == pytest.approx(60.180, abs=0.001)
    assert p[-1] == pytest.approx(0.300, abs=1e-4)
    assert crossing(p, 0.15, plant.h) == pytest.approx(0.0245, abs=0.003)
    assert crossing(p, 0.27, plant.h) == pytest.approx(0.075, abs=0.003)
    assert p.max() < 0.3003


def test_the_default_filter_is_critically_damped() -> None:
    """Row 8: with the default filter the P-f loop has the poles -50 +- j1.5 1/s."""
    plant = on_stiff_bus(GFM_D, h=0.0002)
    plant.inverters.set_points[0, 0] = 0.001

    filtered = []
    for _ in range(300):
        plant.run(5)
        filtered.append(float(plant.inverters.gfm_state["p"][0]) / 0.001)
    t = 0.001 * np.arange(1, 301)
    a, b = 50.0, 1.5
    expected = 1.0 - np.exp(-a * t) * (np.cos(b * t) + a / b * np.sin(b * t))

    assert np.abs(np.array(filtered) - expected).max() < 0.02


def test_two_gfm_share_by_their_set_points() -> None:
    """Row 9: equal droops split what set-points leave over equally."""
    plant = pair(GFM_A, GFM_A, 1.8)
    plant.inverters.set_points[:, 0] = 0.9, 0.5

    end = plant.run(5000)[-1]

    assert end[:, 1] / S_B == pytest.approx([1.1, 0.7], abs=1e-3)
    assert end[:, 0] == pytest.approx(59.880, abs=0.001)


def test_the_overload_limiter_hands_over() -> None:
    """Row 10: with Pmax 1 the first unit stays at 1 pu, the second takes the rest and sets the frequency."""
    plant = pair(replace(GFM_A, P_max=1.0), GFM_A, 1.8)
    plant.inverters.set_points[:, 0] = 0.9, 0.5

    end = plant.run(10000)[-1]

    assert end[:, 1] / S_B == pytest.approx([1.000, 0.800], abs=1e-3)
    assert end[:, 0] == pytest.approx(59.820, abs=0.001)
    assert plant.inverters.gfm_state["x_over"][0] == pytest.approx(-0.754, abs=0.004)


@pytest.mark.parametrize(
    ("k_pp", "k_ip", "peak", "at", "quiet"),
    [(3.0, 30.0, (0.666, 0.671), 0.076, 0.63), (0.0, 90.9, (0.703, 0.709), 0.082, 0.38)],
)
def test_the_limiter_on_a_stiff_bus(
    k_pp: float, k_ip: float, peak: tuple[float, float], at: float, quiet: float
) -> None:
    """Rows 11 and 12: P_set 0.8 over Pmax 0.5 overshoots as computed and ends at 0.5 with x+ = -1.131 rad/s."""
    plant = on_stiff_bus(replace(GFM_A, P_max=0.5, k_pp=k_pp, k_ip=k_ip))
    plant.inverters.set_points[0, 0] = 0.8

    p = plant.run(3000)[:, 0, 1] / S_B

    assert peak[0] - 0.01 <= p.max() <= peak[1] + 0.01
    assert np.argmax(p) * plant.h == pytest.approx(at, abs=0.004)
    assert settled(p, 0.5, 0.01, plant.h) == pytest.approx(quiet, abs=0.02)
    assert p[-1] == pytest.approx(0.5, abs=1e-4)
    assert plant.inverters.gfm_state["x_over"][0] == pytest.approx(-1.131, abs=1e-3)


def test_a_gfm_does_not_absorb() -> None:
    """Row 13: pushed below Pmin = 0 a GFM speeds up until it delivers nothing, above its droop frequency."""
    plant = pair(GFM_A, GFM_A, 0.2)
    plant.inverters.set_points[:, 0] = 0.1, 0.9

    end = plant.run(10000)[-1]
    p = end[:, 1] / S_B

    assert p[0] == pytest.approx(0.0, abs=1e-3)
    assert plant.inverters.gfm_state["x_under"][0] > 0.1
    assert end[0, 0] > 60.0 + 0.6 * (0.1 - p[0]) + 0.01
