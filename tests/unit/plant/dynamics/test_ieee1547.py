"""Volt-var and freq-watt with the dead bands of IEEE 1547-2018, beside EPRI's OpenDER (package opender) on ramps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace
from numpy.typing import NDArray

from gridpeers.plant.dynamics.kernel import gfl
from gridpeers.plant.dynamics.kernel.compiled import Real
from tests.unit.plant.dynamics.circuits import BALANCED, GFL_D, S_B, V_B, on_stiff_bus

OPEN_LOOP = 5.0
"""Open-loop response time of both functions (s): to 90 % of a step, 2.3 time constants."""

CATEGORY_B = replace(
    GFL_D,
    model="current_source",
    volt_var=True,
    frequency_watt=True,
    dead_band="ieee1547",
    db_UV=0.02,
    db_OV=0.02,
    db_UF=0.036,
    db_OF=0.036,
    Q_max=0.44,
    Q_min=-0.44,
    T_ff=0.01,
    T_vf=0.01,
    T_pf=OPEN_LOOP / 2.3,
    T_qf=OPEN_LOOP / 2.3,
)
"""The standard's default settings: V1 to V4 are 0.92, 0.98, 1.02 and 1.08 pu."""

M_P, M_Q = 0.05, 0.06 / 0.44
"""k_OF and k_UF, and (V2 - V1) / Q1."""

P_SET = 0.5


def record() -> Any:
    """Return the inverter as the compiled pass has it."""
    return on_stiff_bus(CATEGORY_B, m_p=M_P, m_q=M_Q).inverters.gfl[0]


@pytest.mark.parametrize(
    ("V", "Q"),
    [
        (0.90, 0.44),
        (0.92, 0.44),
        (0.94, 0.44 * 4 / 6),
        (0.98, 0.0),
        (1.0, 0.0),
        (1.02, 0.0),
        (1.05, -0.22),
        (1.1, -0.44),
    ],
)
def test_volt_var_is_the_standards_line_through_four_points(V: float, Q: float) -> None:
    """There are no vars within the band, and Q goes from its edges to Q1 and Q4 without a jump."""
    assert gfl.var_reference(record(), 1.0, 0.0, V, P_SET) == pytest.approx(Q, abs=1e-12)
    assert gfl.var_reference(record(), 0.97, 0.0, V - 0.03, P_SET) == pytest.approx(Q, abs=1e-12)  # V_ref moves it


@pytest.mark.parametrize(("f", "P"), [(60.03, 0.5), (59.97, 0.5), (60.336, 0.4), (59.664, 0.6), (57.0, 1.0)])
def test_frequency_watt_begins_at_the_edge_of_its_dead_band(f: float, P: float) -> None:
    """P = P_pre + ((60 - db) - f) / (60 k) below the band, the same with f - (60 + db) above, up to P_max."""
    assert gfl.power_reference(record(), P_SET, f) == pytest.approx(P, abs=1e-12)


def opender(monkeypatch: pytest.MonkeyPatch, h: float, V: Real, f: Real) -> NDArray[np.float64]:
    """Return P and Q (pu) of EPRI's model, a row for each V (pu) and f (Hz) of a ramp, in steps of h (s)."""
    model = pytest.importorskip("opender", reason="the comparison with OpenDER needs the extra validation")
    monkeypatch.setattr(model.DER, "t_s", h)
    der = model.DER_PV()
    settings = {"CONST_PF_MODE_ENABLE": False, "QV_MODE_ENABLE": True, "AP_LIMIT_ENABLE": True, "AP_LIMIT": P_SET}
    for key, value in (settings | {"QV_OLRT": OPEN_LOOP, "PF_OLRT": OPEN_LOOP}).items():
        setattr(der.der_file, key, value)
    rows = []
    for V_now, f_now in zip(V.tolist(), f.tolist(), strict=True):
        der.update_der_input(v_pu=V_now, f=f_now, p_dc_pu=1.0)
        der.run()
        rows.append((der.p_out_pu, der.q_out_pu))
    return np.array(rows)


def ramp(to: float, at: float, n: int) -> Real:
    """Return n values from `at` to `to`, and back."""
    there = np.linspace(at, to, n // 2)
    return np.concatenate([there, there[::-1]])


@pytest.mark.parametrize("to", [0.89, 1.095])
def test_vars_at_rest_are_openders(monkeypatch: pytest.MonkeyPatch, to: float) -> None:
    """On a ramp that is slow beside every lag, out to the limits of continuous operation and back, Q is OpenDER's."""
    V = ramp(to, 1.0, 400)

    theirs = opender(monkeypatch, 1e5, V, np.full(V.size, 60.0))[:, 1]

    assert theirs == pytest.approx([gfl.var_reference(record(), 1.0, 0.0, v, P_SET) for v in V], abs=1e-9)
    assert abs(theirs).max() == pytest.approx(0.44)


@pytest.mark.parametrize("to", [58.6, 61.1])
def test_power_at_rest_is_openders(monkeypatch: pytest.MonkeyPatch, to: float) -> None:
    """On such a ramp of the frequency P is OpenDER's, whose power before the disturbance is our P_set."""
    f = ramp(to, 60.0, 400)

    theirs = opender(monkeypatch, 1e5, np.ones(f.size), f)[:, 0]

    assert theirs == pytest.approx([gfl.power_reference(record(), P_SET, each) for each in f], abs=1e-9)
    assert abs(theirs - P_SET).max() > 0.3


@pytest.mark.parametrize(("V_to", "f_to"), [(0.90, 61.0), (1.09, 59.0)])
def test_a_ramp_in_time_gives_openders_powers(monkeypatch: pytest.MonkeyPatch, V_to: float, f_to: float) -> None:
    """On a ramp over 10 s and back, both with an open-loop response time of 5 s, P and Q are OpenDER's in 0.001 pu."""
    h, steps = 0.004, 5_000
    V, f = ramp(V_to, 1.0, steps), ramp(f_to, 60.0, steps)
    plant = on_stiff_bus(CATEGORY_B, m_p=M_P, m_q=M_Q, h=h)
    plant.start(np.array([P_SET]), V_set=np.ones(1))

    theirs = opender(monkeypatch, h, V, f)

    units = plant.inverters
    state, g, J = units.gfl_state, units.gfl[0], units.J[0].copy()
    theta, ours = 0.0, []
    for v, df in zip(V.tolist(), (f - 60.0).tolist(), strict=True):
        x0, d = state.copy(), state.copy()
        for second in (False, True):
            bus = v * V_B * BALANCED * np.exp(1j * (theta + 2.0 * np.pi * df * h * second))
            S = np.sum(bus * np.conj(J - g["y_f"] * bus)) / S_B
            J = np.array(gfl.advance_gfl(g, *units.set_points[0], x0[0], state[0], d[0], *bus, *J, h, second))
        theta += 2.0 * np.pi * df * h
        ours.append((S.real, S.imag))
    assert np.abs(np.array(ours) - theirs).max() < 0.001
    assert np.ptp(theirs, axis=0).max() > 0.2
