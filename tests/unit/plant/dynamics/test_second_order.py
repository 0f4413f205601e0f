"""The second-order method of time stepping: what a model gives it, what it keeps, and how its error falls with h."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace
from numpy.typing import NDArray

from bench.validation.gfm_gfl import gfm_gfl_circuit
from gridpeers.plant.dynamics import Dynamics
from gridpeers.plant.dynamics.kernel import gfl, gfm
from gridpeers.plant.feeder import Plant
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import GflParameters, GfmParameters, Method, PlantSettings
from gridpeers.plant.tables import read_feeder
from tests.unit.plant.dynamics.circuits import (
    BALANCED,
    GFL_D,
    GFM_D,
    S_B,
    V_B,
    circuit,
    inverter,
)

WATT_VAR = replace(GFL_D, F_current=0.6, frequency_watt=True, volt_var=True)


def gfm_pass(par: GfmParameters) -> Any:
    """Return a pass of a GFM that meets 0.4 + 0.1j pu at 0.98 pu."""
    record = gfm.pack(par, S_B, V_B, 0.01, 0.05, 60.0)[()]

    def advance(x0: Any, x: Any, d: Any, h: float, second: bool) -> None:
        gfm.advance_gfm(record, 0.5, 1.0, x0, x, d, 0.4, 0.1, 0.98, h, second)

    return advance


def gfl_pass(par: GflParameters) -> Any:
    """Return a pass of a GFL that meets 0.98 pu, turned by 0.1 rad, at a current of 0.4 pu."""
    record = gfl.pack(par, S_B, V_B, 0.01, 0.05, 60.0, "second-order")[()]
    V = 0.98 * V_B * BALANCED * np.exp(0.1j)
    J = 0.4 * record["I_b"] * BALANCED

    def advance(x0: Any, x: Any, d: Any, h: float, second: bool) -> None:
        gfl.advance_gfl(record, 0.5, 1.0, 0.0, x0, x, d, *V, *J, h, second)

    return advance


@pytest.mark.parametrize(
    ("state", "advance"),
    [
        (gfm.STATE, gfm_pass(GFM_D)),
        (gfm.STATE, gfm_pass(replace(GFM_D, voltage_control=False))),
        (gfl.STATE, gfl_pass(WATT_VAR)),
        (gfl.STATE, gfl_pass(replace(WATT_VAR, model="current_source"))),
        (gfl.STATE, gfl_pass(replace(WATT_VAR, mode="balanced_power"))),
    ],
    ids=["GFM", "GFM without voltage controller", "GFL", "GFL current source", "GFL of balanced power"],
)
def test_a_pass_of_length_0_gives_the_slopes_and_moves_no_state(state: np.dtype[Any], advance: Any) -> None:
    """Both methods integrate the same right-hand side: the limit of a short pass's slopes is that of the empty one."""
    start = np.zeros(1, state)
    for k, name in enumerate(state.names or ()):
        start[name] = 0.3 + 0.05 * k
    start["f_m" if "f_m" in (state.names or ()) else "w"] = 60.0 if "f_m" in (state.names or ()) else 0.0
    for name in ("x_over", "y_over"):
        if name in (state.names or ()):
            start[name] *= -1.0  # within its limits
    still, moved = start.copy(), start.copy()
    d, short = np.zeros(1, state), np.zeros(1, state)

    advance(still[0], still[0], d[0], 0.0, False)
    advance(start[0], moved[0], short[0], 1e-9, False)

    states = [name for name in state.names or () if name not in ("E", "w", "f")]
    for name in states:
        assert still[name] == start[name], name
        assert d[name] == pytest.approx(short[name], rel=1e-5, abs=1e-9), name
        assert moved[name] - start[name] == pytest.approx(1e-9 * d[name], rel=1e-4, abs=1e-14), name
    assert any(d[name] != 0.0 for name in states)


@pytest.mark.parametrize("model", ["voltage_source", "current_source"])
def test_the_feeder_rests_in_the_second_order_method(model: str) -> None:
    """Both methods have the same equilibrium: without an event nothing moves for 2 s."""
    settings = PlantSettings(method="second-order", gfl=GflParameters(model=model))
    plant = Plant(Network(read_feeder("microgrid123")), settings, 0.02, 0.02)
    first = plant.measure()

    for _ in range(100):
        plant.advance()

    for name, now in plant.measure().items():
        assert pytest.approx(first[name].P, abs=1e-6) == now.P
        assert pytest.approx(first[name].Q, abs=1e-6) == now.Q
        assert now.f == pytest.approx(60.0, abs=1e-9)


def after_a_load_step(method: Method, h: float) -> NDArray[np.float64]:
    """Return f (Hz), and P, Q (pu) of the autotest system's GFM and GFL every 4 ms after a load step."""
    gfl = replace(GFL_D, frequency_watt=True, volt_var=True, F_current=0.6, T_ff=0.02, T_pf=0.05)
    system = Dynamics(gfm_gfl_circuit(5.76), (inverter(GFM_D), inverter(gfl)), h, method=method)
    system.start(np.full(2, 0.3), np.array([0.0, 0.05]))
    system.connect(gfm_gfl_circuit(2.304 + 4.608j))
    stride = round(0.004 / h)
    return system.run(12 * stride)[stride - 1 :: stride, :, :3] / [1.0, S_B, S_B]


def test_the_error_falls_with_the_square_of_the_step() -> None:
    """Half the step has a quarter of the error in the second-order method, half of it in the default one."""
    exact = after_a_load_step("second-order", 0.0000625)

    error = {
        (method, h): np.abs(after_a_load_step(method, h) - exact).max(axis=(0, 1))
        for method, steps in (("second-order", (0.002, 0.001)), ("first-order", (0.00025, 0.000125)))
        for h in steps
    }

    assert (error["second-order", 0.002] / error["second-order", 0.001] > 3.4).all()
    assert (error["second-order", 0.002] / error["second-order", 0.001] < 5.0).all()
    assert (error["first-order", 0.00025] / error["first-order", 0.000125] > 1.7).all()
    assert (error["first-order", 0.00025] / error["first-order", 0.000125] < 2.3).all()
    assert (error["second-order", 0.002] < error["first-order", 0.000125]).all()


def test_limits_hold_a_gfm_as_in_the_default_method() -> None:
    """The overload limiter settles at the same frequency and power: clips of integrators act in either method."""
    ends = []
    for method in ("first-order", "second-order"):
        gfm = replace(GFM_D, P_max=0.4)
        system = Dynamics(gfm_gfl_circuit(5.76), (inverter(gfm), inverter(GFL_D)), 0.002, method=method)
        system.start(np.full(2, 0.3), np.array([0.0, 0.05]))
        system.connect(gfm_gfl_circuit(2.304))
        end = system.run(1000)[-1, :, :3]
        ends.append(end)
        assert system.inverters.gfm_state["x_over"][0] < 0.0

    assert ends[0] == pytest.approx(ends[1], rel=1e-3)


def test_feed_forward_that_diverges_pass_by_pass_is_solved() -> None:
    """F_current = 1 decouples the axes exactly; only a delay of a pass makes it diverge, and here there is none."""
    par = replace(GFL_D, F_current=1.0)
    bus = circuit(np.zeros((3, 3), complex), [[0, 1, 2]], source=V_B * BALANCED)
    system = Dynamics(bus, (inverter(par),), 0.002, method="second-order")
    system.start(np.zeros(1), np.zeros(1))
    system.inverters.set_points[0, 0] = 0.3

    P = system.run(1000)[:, 0, 1] / S_B

    assert P.max() < 0.31
    assert P[-1] == pytest.approx(0.3, abs=1e-4)
