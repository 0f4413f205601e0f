"""Checklist rows 14 to 23: the grid-following inverter."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace
from numpy.typing import NDArray

from gridpeers.plant.dynamics import Dynamics
from gridpeers.plant.dynamics.kernel import gfl
from gridpeers.plant.plant_config import GflParameters
from tests.unit.plant.dynamics.circuits import BALANCED, GFL_D, S_B, V_B, move_source, on_stiff_bus
from tests.unit.plant.dynamics.test_gfm import crossing

WATT = replace(GFL_D, frequency_watt=True, T_ff=0.05)


def frequency_step(plant: Dynamics, df: float, seconds: float) -> NDArray[np.float64]:
    """Turn the stiff bus at 60 + df Hz from label 0 on; returns rows of f (Hz) and p (pu).

    The bus moves between the two solutions of a step, too, which the plant's fixed sources do not; on a stiff bus the
    network solution is the bus itself, so the inverter's passes can be called without it.
    """
    units, h = plant.inverters, plant.h
    state, g, J = units.gfl_state, units.gfl[0], units.J[0].copy()
    rows = []
    for k in range(round(seconds / h)):
        x0, d = state.copy(), state.copy()
        for second in (False, True):
            V = V_B * BALANCED * np.exp(2j * np.pi * df * (k + second) * h)
            p = np.sum(V * np.conj(J - g["y_f"] * V)).real / S_B
            P_set, V_set, Q_set = units.set_points[0]
            J = np.array(gfl.advance_gfl(g, P_set, V_set, Q_set, x0[0], state[0], d[0], *V, *J, h, second))
        rows.append((float(state["f"][0]), p))
    return np.array(rows)


@pytest.mark.parametrize(("h", "expected"), [(0.002, 61.4315), (0.0002, 61.387)])
def test_the_plls_first_answer_to_a_phase_jump(h: float, expected: float) -> None:
    """Row 14: a jump of 10 degrees shows at once through both gains, before the corrector."""
    units = on_stiff_bus(GFL_D, h=h).inverters
    x, d = units.gfl_state.copy(), units.gfl_state.copy()
    V = V_B * BALANCED * np.exp(1j * np.deg2rad(10.0))

    gfl.advance_gfl(units.gfl[0], 0.0, 1.0, 0.0, units.gfl_state[0], x[0], d[0], *V, *units.J[0], h, False)

    assert x["f"][0] == pytest.approx(expected, abs=0.01)


def test_the_pll_after_a_phase_jump() -> None:
    """Row 14: it undershoots to 59.940 Hz a tenth of a second after the jump."""
    plant = on_stiff_bus(GFL_D)
    move_source(plant, V_B * BALANCED * np.exp(1j * np.deg2rad(10.0)))

    f = plant.run(200)[:, 0, 0]

    assert f.min() == pytest.approx(59.940, abs=0.01)
    assert np.argmin(f) * plant.h == pytest.approx(0.105, abs=0.003)


def test_the_pll_after_a_frequency_step() -> None:
    """Row 15: -0.3 Hz is overshot by 17 % at 70 ms and met to 2 % from 0.17 s on."""
    # the row is the continuous PLL's; at h = 2 ms the explicit step gives 59.6526 Hz, at 0.2 ms 59.6491 Hz
    plant = on_stiff_bus(GFL_D, h=0.0002)

    f = frequency_step(plant, -0.3, 0.5)[:, 0]

    assert f.min() == pytest.approx(59.648, abs=0.002)
    assert np.argmin(f) * plant.h == pytest.approx(0.070, abs=0.004)
    assert np.abs(f[round(0.17 / plant.h) :] - 59.7).max() == pytest.approx(0.02 * 0.3, abs=2e-4)


def test_frequency_watt() -> None:
    """Row 16: 1 % droop gives 0.5 pu for -0.3 Hz, through the lags of 0.05 and 0.5 s."""
    plant = on_stiff_bus(WATT)
    plant.inverters.set_points[0, 0] = 0.3
    plant.run(3000)

    p = frequency_step(plant, -0.3, 6.0)[:, 1]

    assert p[-1] == pytest.approx(0.800, rel=0.01)
    assert crossing(p - 0.3, 0.5 * (1.0 - np.exp(-1.0)), plant.h) == pytest.approx(0.55, rel=0.01)
    assert crossing(p - 0.3, 0.5 * 0.95, plant.h) == pytest.approx(1.54, rel=0.01)


def test_frequency_watt_with_the_default_droop() -> None:
    """Row 17: 5 % droop gives 0.1 pu for -0.3 Hz."""
    plant = on_stiff_bus(WATT, m_p=0.05)

    p = frequency_step(plant, -0.3, 6.0)[:, 1]

    assert p[-1] == pytest.approx(0.1, abs=1e-3)


def test_the_dead_band_jumps() -> None:
    """Row 18: past the edge of the dead band the full deviation acts."""
    record = on_stiff_bus(replace(WATT, db_UF=0.036, db_OF=0.036)).inverters.gfl[0]

    assert gfl.power_reference(record, 0.3, 59.965) == pytest.approx(0.3, abs=1e-12)
    assert gfl.power_reference(record, 0.3, 59.963) == pytest.approx(0.3 + 0.0617, abs=1e-4)


def test_volt_var() -> None:
    """Row 19: 5 % droop gives 0.4 pu of var for -2 %, through the lags of 0.05 and 0.2 s."""
    plant = on_stiff_bus(replace(GFL_D, volt_var=True))
    move_source(plant, 0.98 * V_B * BALANCED)

    q = plant.run(2000)[:, 0, 2] / S_B

    assert q[-1] == pytest.approx(0.400, rel=0.01)
    assert crossing(q, 0.4 * (1.0 - np.exp(-1.0)), plant.h) == pytest.approx(0.25, abs=0.006)


def test_var_takes_what_power_leaves() -> None:
    """Row 20: at P_d = 0.8 the var reference is clipped at 0.6."""
    record = on_stiff_bus(replace(GFL_D, volt_var=True)).inverters.gfl[0]

    assert gfl.var_reference(record, 1.0, 0.0, 0.9, 0.8) == pytest.approx(0.6, abs=1e-6)


def test_the_current_loop() -> None:
    """Row 21: a step of P* of 0.3 rings at 4.57 Hz, with the overshoot and decay of the pole -11.49 +- j28.74 1/s."""
    plant = on_stiff_bus(GFL_D)
    plant.inverters.set_points[0, 0] = 0.3
    plant.run(3000)
    plant.inverters.set_points[0, 0] = 0.6

    out = plant.run(1000)[:, 0] / S_B
    p, q = out[:, 1], out[:, 2]
    z, k_pc = 0.01 + 0.15j, 0.05
    s = -5.0 / (z + k_pc)
    t = plant.h * np.arange(1, 501)
    exact = 0.6 - 0.3 * (z / (z + k_pc) * np.exp(s * t)).real

    assert s == pytest.approx(-11.49 + 28.74j, rel=1e-3)
    assert p.max() == pytest.approx(0.698, rel=0.01)
    assert np.argmax(p) * plant.h == pytest.approx(0.0835, abs=0.003)
    assert 0.18 - 0.002 <= np.abs(q).max() <= 0.19 + 0.002
    assert np.abs(p[:500] - exact)[5:].max() < 0.01 * 0.6


def test_the_current_reference_is_clipped() -> None:
    """Row 22: at half voltage 0.8 pu of power would need 1.6 pu of current; 1.0 is given, and 0.5 pu of power."""
    plant = on_stiff_bus(GFL_D)
    plant.inverters.set_points[0, 0] = 0.8
    plant.run(2000)
    move_source(plant, 0.5 * V_B * BALANCED)

    plant.run(3000)
    units = plant.inverters
    i = units.I[0, 0] * np.exp(-1j * units.gfl_state["theta"][0]) / units.gfl["I_b"][0]

    assert i.real == pytest.approx(1.0, abs=1e-3)
    assert plant.readings()[0, 1] / S_B == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize("wrong", [replace(GFL_D, F_current=1.0), replace(GFL_D, k_pc=0.2)])
def test_a_diverging_current_controller_is_refused(wrong: GflParameters) -> None:
    """Row 23: gains whose one-pass feedback grows on a stiff bus are refused with the ratio and the remedy."""
    with pytest.raises(ValueError, match=r"must be below 1, got 1\.\d\d"):
        gfl.pack(wrong, S_B, V_B, 0.01, 0.05, 60.0)


def test_the_refused_gains_do_diverge() -> None:
    """Row 23: the refusal is not overcautious: let through, the gains blow up."""
    plant = on_stiff_bus(GFL_D)
    plant.inverters.gfl["F_current"] = 1.0
    plant.inverters.set_points[0, 0] = 0.3

    p = plant.run(200)[:, 0, 1] / S_B

    assert np.abs(p).max() > 100.0
