"""The second-order method of time stepping: what a model gives it, and what it keeps."""

from __future__ import annotations

from copy import copy
from types import SimpleNamespace

import numpy as np
import pytest
from msgspec.structs import replace

from bench.validation.gfm_gfl import gfm_gfl_circuit
from gridpeers.plant.dynamics import Dynamics
from gridpeers.plant.dynamics.inverters import Inverters
from gridpeers.plant.feeder import Plant
from gridpeers.plant.inverters.gfl import Gfl
from gridpeers.plant.inverters.inverter_model import InverterModel
from gridpeers.plant.inverters.regfm_a1 import REGFM_A1
from gridpeers.plant.inverters.vsm import Vsm
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings
from gridpeers.plant.tables import read_feeder
from tests.unit.plant.dynamics.circuits import (
    BALANCED,
    GFL_D,
    GFM_D,
    S_B,
    V_B,
    at_terminal,
    by_name,
    inverter,
    on_stiff_bus,
)

WATT_VAR = replace(GFL_D, F_current=0.6, frequency_watt=True, volt_var=True)


@pytest.mark.parametrize(
    "model",
    [
        GFM_D,
        replace(GFM_D, voltage_control=False),
        REGFM_A1,
        Vsm(D=20.0),
        WATT_VAR,
        replace(WATT_VAR, model="current_source"),
        replace(WATT_VAR, mode="balanced_power"),
    ],
    ids=[
        *("GFM", "GFM without voltage controller", "REGFM_A1", "VSM", "GFL", "GFL current source"),
        "GFL of balanced power",
    ],
)
def test_a_pass_of_length_0_gives_the_slopes_and_moves_no_state(model: InverterModel) -> None:
    """Both methods integrate the same right-hand side: the limit of a short pass's slopes is that of the empty one."""
    units = Inverters((inverter(model),), method="second-order")
    g, names = by_name(units.constants(0)), units.state_of(0).dtype.names or ()
    V = 0.98 * V_B * BALANCED * np.exp(0.1j)
    J = 0.4 * g.I_b * BALANCED + g.y_f * V
    start = SimpleNamespace(**{name: 0.3 + 0.05 * k for k, name in enumerate(names)})
    if "f_m" in names:
        start.f_m = 60.0
    for name in {"x_over", "y_over"} & set(names):
        setattr(start, name, -getattr(start, name))  # within its limits
    still, moved = copy(start), copy(start)
    d, short = (SimpleNamespace(**dict.fromkeys(names, 0.0)) for _ in range(2))

    model.advance(g, at_terminal(V, J, g.y_f, 0.5, 1.0, 0.0), still, still, d, 0.0, False)
    model.advance(g, at_terminal(V, J, g.y_f, 0.5, 1.0, 0.0), start, moved, short, 1e-9, False)

    states = [name for name in names if getattr(d, name) != 0.0]
    assert len(states) >= len(names) - 7  # outputs, and states of the other mode
    for name in states:
        slope = getattr(d, name)
        assert getattr(still, name) == getattr(start, name), name
        assert slope == pytest.approx(getattr(short, name), rel=1e-5, abs=1e-9), name
        assert getattr(moved, name) - getattr(start, name) == pytest.approx(1e-9 * slope, rel=1e-4, abs=1e-14), name


@pytest.mark.parametrize("model", ["voltage_source", "current_source"])
def test_the_feeder_rests_in_the_second_order_method(model: str) -> None:
    """Both methods have the same equilibrium: without an event nothing moves for 2 s."""
    settings = PlantSettings(method="second-order", gfl=Gfl(model=model))
    plant = Plant(Network(read_feeder("microgrid123")), settings, 0.02, 0.02)
    first = plant.measure()

    for _ in range(100):
        plant.advance()

    for name, now in plant.measure().items():
        assert pytest.approx(first[name].P, abs=1e-6) == now.P
        assert pytest.approx(first[name].Q, abs=1e-6) == now.Q
        assert now.f == pytest.approx(60.0, abs=1e-9)


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
        assert system.inverters.state_of(0)["x_over"] < 0.0

    assert ends[0] == pytest.approx(ends[1], rel=1e-3)


def test_feed_forward_that_diverges_pass_by_pass_is_solved() -> None:
    """F_current = 1 decouples the axes exactly; only a delay of a pass makes it diverge, and here there is none."""
    par = replace(GFL_D, F_current=1.0)
    system = on_stiff_bus(par, method="second-order")
    system.inverters.set_points[0, 0] = 0.3

    P = system.run(1000)[:, 0, 1] / S_B

    assert P.max() < 0.31
    assert P[-1] == pytest.approx(0.3, abs=1e-4)
