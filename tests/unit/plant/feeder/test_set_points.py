"""Set-points beyond an inverter's bounds are limited and reported, and never end a run."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace

from gridpeers.plant.dynamics import Dynamics, PlantError
from gridpeers.plant.dynamics.kernel import gfl
from gridpeers.plant.feeder import Plant
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import GflParameters, GfmParameters, PlantSettings
from gridpeers.plant.tables import read_feeder
from tests.unit.plant.dynamics.circuits import BALANCED, GFL_D, V_B, on_stiff_bus
from tests.unit.plant.feeder.test_feeder import opened, plant, run

OVER_HZ = 0.2
"""Over-frequency of the stiff bus (Hz): a third of the rating at 1 % droop."""


def islanded() -> Plant:
    """Give the microgrid feeder, islanded for a second."""
    p = plant(*opened(0.1, "13-152"))
    run(p, 1.0)
    p.take_events()
    return p


def frequencies(p: Plant) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Give the recorded frequencies (Hz), a row per control period."""
    return np.array(p.take_rows())[:, 1::6]


@pytest.mark.parametrize("P_set", [1e7, 1e12, -1e12, 1e300])
def test_a_gfm_told_nonsense_holds_its_bound_and_the_run_goes_on(P_set: float) -> None:
    """10 MW ended the plant by no convergence, 1 TW gave 1 MHz: P_set is bounded at 3 pu, and so is the frequency."""
    p = islanded()
    p.take_rows()

    for _ in range(100):
        p.hold("inv1", P_set, 2401.8)
        p.advance()

    assert p.measure()["inv1"].P_set == pytest.approx(np.sign(P_set) * 3.0 * 600e3)
    assert np.all(np.abs(frequencies(p) - 60.0) < 2.0)


def test_a_voltage_set_point_of_nonsense_is_held_within_its_band() -> None:
    """V_set of ten times nominal is held at 1.2 pu, V_set 0 at 0.8 pu."""
    p = islanded()

    p.hold("inv1", 300e3, 24e3)
    p.hold("inv2", 200e3, 0.0)

    readings = p.measure()
    assert readings["inv1"].V_set == pytest.approx(1.2 * 2401.8, rel=1e-3)
    assert readings["inv2"].V_set == pytest.approx(0.8 * 2401.8, rel=1e-3)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_set_points_that_are_no_numbers_are_left_out(value: float) -> None:
    """Neither NaN nor an infinity gets in, alone or beside a good value."""
    p = islanded()
    before = p.measure()["inv1"]

    p.hold("inv1", value, 2401.8)
    p.hold("inv1", 300e3, value)

    after = p.measure()["inv1"]
    assert (after.P_set, after.V_set) == (before.P_set, before.V_set)
    assert [event.subject for event in p.take_events()] == ["inv1"]


def test_a_spell_of_limited_set_points_is_told_once_with_value_and_bound() -> None:
    """A hundred set-points beyond the bound make one event with the value and the bound, and one at their end."""
    p = islanded()

    for _ in range(100):
        p.hold("inv1", 1e7, 2401.8)
        p.advance()
    begun = p.take_events()
    for _ in range(60):
        p.hold("inv1", 3e5, 2401.8)
        p.advance()

    begun = tuple(event for event in begun if "P_set" in event.text)  # beside that of its phase currents
    assert [(event.kind, event.subject) for event in begun] == [("limit", "inv1")]
    assert "10000 kW" in begun[0].text
    assert "1800 kW" in begun[0].text
    (ended,) = p.take_events()
    assert "100 set-points" in ended.text


def over_frequency(parameters: GflParameters, P_set: float) -> float:
    """Tell a GFL on a stiff bus P_set (pu), and raise the frequency it measures; return the P reference (pu)."""
    dynamics: Dynamics = on_stiff_bus(parameters)
    units, h = dynamics.inverters, dynamics.h
    units.hold(0, P_set, 1.0)
    state, J = units.gfl_state, units.J[0].copy()
    for k in range(1000):
        x0, d = state.copy(), state.copy()
        for second in (False, True):
            V = V_B * BALANCED * np.exp(2j * np.pi * OVER_HZ * (k + second) * h)
            J = np.array(gfl.advance_gfl(units.gfl[0], *units.set_points[0], x0[0], state[0], d[0], *V, *J, h, second))
    return float(state["P_f"][0])


def test_a_gfl_reference_above_the_rating_is_clipped_in_place_as_in_gridlabd() -> None:
    """inverter-models 4.4: at P_set 1.2 pu a GFL gives 1 - 1/3 pu at 60.2 Hz; without the limit it gives 1.2 - 1/3."""
    parameters = replace(GFL_D, frequency_watt=True, T_ff=0.05, T_pf=0.05)

    assert over_frequency(parameters, 1.2) == pytest.approx(1.0 - OVER_HZ / 0.6, abs=1e-3)
    assert over_frequency(replace(parameters, P_set_lim=3.0), 1.2) == pytest.approx(1.2 - OVER_HZ / 0.6, abs=1e-3)


def test_a_start_beyond_the_limits_of_the_gfm_that_holds_an_island_up_is_refused() -> None:
    """A start at which the overload limiter already acts is no equilibrium: f would dip without an event."""
    with pytest.raises(PlantError, match=r"no equilibrium at t = 0: inv1 would have to give \d+ kW, .*P_set0_pu"):
        Plant(Network(read_feeder("microgrid123")), PlantSettings(P_set0=1.1, gfl=GflParameters(P_max=1.1)), 0.02, 0.02)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (PlantSettings(V_set0=1.2), r"inv1 would have to have an internal voltage of 1\.\d+ pu, .*E_max_pu"),
        (PlantSettings(gfm=GfmParameters(Q_max=0.01)), r"inv1 would have to give \d+(\.\d+)? kvar, .*Q_max_pu"),
    ],
)
def test_a_start_beyond_the_limits_of_vars_or_voltage_is_refused(settings: PlantSettings, said: str) -> None:
    """As with power: 100 kvar would move within the first second, without an event."""
    with pytest.raises(PlantError, match=f"no equilibrium at t = 0: {said}.*V_set0_pu"):
        Plant(Network(read_feeder("microgrid123")), settings, 0.02, 0.02)
