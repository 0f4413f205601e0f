"""Single-phase inverters: one phase of a three-phase one, on a network of their own phase."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from msgspec.structs import replace as changed

from gridpeers.plant.dynamics import Circuit, Dynamics, Inverter
from gridpeers.plant.dynamics.circuit import LoadLaw
from gridpeers.plant.inverters.gfl import Gfl
from gridpeers.plant.inverters.gfm_droop import GfmDroop
from gridpeers.plant.inverters.regfm_a1 import REGFM_A1
from gridpeers.plant.plant_config import Method
from tests.unit.plant.dynamics.circuits import BALANCED, GFL_D, GFM_D, S_B, V_B, Z_B, circuit, inverter, lone

GFL_ON = changed(GFL_D, frequency_watt=True, volt_var=True)
METHODS: tuple[Method, ...] = ("first-order", "second-order")
LINE = 1.0 / ((0.02 + 0.05j) * Z_B)


def single(parameters: GfmDroop | Gfl, phase: str, *, part: float = 1.0 / 3.0) -> Inverter:
    """An inverter of a third of 200 kVA on one phase."""
    return replace(inverter(parameters), name=f"single {phase}", phases=phase, S_b=S_B * part)


def pair_of(phases: int, load: float) -> Circuit:
    """Two terminals behind lines with a load between them (pu of three phases), on one phase or on three."""
    Y = np.kron(np.array([[LINE, 0, -LINE], [0, LINE, -LINE], [-LINE, -LINE, 2 * LINE + load / Z_B]]), np.eye(phases))
    terminals = [[0] * 3, [1] * 3] if phases == 1 else [[0, 1, 2], [3, 4, 5]]
    return circuit(Y, terminals)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("gfm", "gfl", "phase"),
    [
        (GFM_D, GFL_ON, "B"),
        (REGFM_A1, changed(GFL_ON, model="current_source"), "C"),
        (changed(REGFM_A1, voltage_control=False), changed(GFL_ON, mode="balanced_power"), "B"),
        (changed(GFM_D, I_max=0.9), GFL_D, "C"),
    ],
    ids=["GFM, GFL", "REGFM_A1, current source", "VFlag 0, balanced power", "current limit"],
)
def test_it_is_a_third_of_a_balanced_three_phase_inverter(gfm: GfmDroop, gfl: Gfl, phase: str, method: Method) -> None:
    """On a third of the network it has a third of the power, and the same f and V, through a load step and a return."""
    runs = []
    for phases, units in ((3, (inverter(gfm), inverter(gfl))), (1, (single(gfm, phase), single(gfl, phase)))):
        dynamics = Dynamics(pair_of(phases, 0.8), units, 0.002, method=method)
        dynamics.start(np.array([0.0, 0.4]), np.array([0.0, 0.1]))
        runs.append([dynamics.readings(), *dynamics.run(20)[:, :, :6]])
        dynamics.connect(pair_of(phases, 1.4))
        runs[-1] += [*dynamics.run(200)[:, :, :6]]
        dynamics.switch_inverters([1], False)
        runs[-1] += [*dynamics.run(50)[:, :, :6]]
        dynamics.switch_inverters([1], True)
        runs[-1] += [*dynamics.run(100)[:, :, :6]]
    whole, third = (np.array([row[:, :4] for row in run]) for run in runs)
    whole[:, :, 1:3] /= 3.0

    np.testing.assert_allclose(third, whole, rtol=1e-9, atol=1e-9 * S_B)
    assert np.ptp(whole[:, :, 1]) > 0.02 * S_B


def beside_three_phases(load_on_B: complex) -> tuple[Circuit, tuple[Inverter, ...]]:
    """A three-phase GFM at nodes 0 to 2, and on a lateral of phase B, node 3, a load, a GFL and behind a line a GFM."""
    Y = np.zeros((5, 5), complex)
    Y[:3, :3] = np.diag([0.3, 0.2, 0.4]) / Z_B
    for one, other in ((1, 3), (3, 4)):
        Y[[one, other], [one, other]] += LINE
        Y[[one, other], [other, one]] -= LINE
    whole = circuit(Y, [[0, 1, 2], [3, 3, 3], [4, 4, 4]])
    C = sp.csc_array(np.array([[0.0], [0.0], [0.0], [1.0], [0.0]]))
    law = LoadLaw(S=np.array([load_on_B * S_B / 3.0]), I0=np.zeros(1, complex))
    units = (inverter(GFM_D), single(GFL_ON, "B"), single(GFM_D, "B", part=0.1))
    return replace(whole, C=C, loads=law, V_branch=V_B * BALANCED[1:2]), units


def test_its_power_is_that_of_its_terminal_and_balances_the_network() -> None:
    """P + jQ is V conj(I) of its node, and all inverters together give what loads and lines take, at every step."""
    network, units = beside_three_phases(0.5 + 0.2j)
    dynamics = Dynamics(network, units, 0.002)
    dynamics.start(np.array([0.0, 0.3, 0.5]), np.zeros(3))
    dynamics.inverters.set_points[1:, 0] = 0.8, 0.2
    for _ in range(5):
        out = dynamics.run(20)[-1]
        held = dynamics.inverters
        at_terminal = held.V[:, 0] * np.conj(held.I[:, 0])
        V = np.array([*held.V[0], held.V[1, 0], held.V[2, 0]])
        drawn = V @ np.conj(network.Y @ V) + (0.5 + 0.2j) * S_B / 3.0

        assert out[1:, 1] + 1j * out[1:, 2] == pytest.approx(at_terminal[1:], rel=1e-12)
        assert np.sum(out[:, 1] + 1j * out[:, 2]) == pytest.approx(drawn, rel=1e-9)


def test_each_of_three_legs_holds_its_own_phase() -> None:
    """Three single-phase GFM on A, B, C of one bus with equal loads rest as one three-phase GFM does."""
    network = circuit(np.eye(3, dtype=complex) * 0.6 / Z_B, [[0, 0, 0], [1, 1, 1], [2, 2, 2]])
    dynamics = Dynamics(network, tuple(single(GFM_D, phase) for phase in "ABC"), 0.002)
    dynamics.start(np.zeros(3), np.zeros(3))

    out = dynamics.run(500)[-1]
    whole = lone(GFM_D, 0.6).run(500)[-1]

    assert dynamics.inverters.V[:, 0] == pytest.approx(V_B * BALANCED, rel=1e-9)
    assert out[:, 0] == pytest.approx(np.full(3, 60.0), abs=1e-9)
    assert out[:, 1] == pytest.approx(np.full(3, whole[0, 1] / 3.0), rel=1e-9)


def test_legs_that_a_load_couples_start_as_one_island() -> None:
    """With loads between the phases each leg still holds its phase at the start, and all rest at 60 Hz."""
    y = 0.3 / Z_B
    delta = y * (3.0 * np.eye(3) - np.ones((3, 3))) + np.diag([0.5, 0.2, 0.1]) / Z_B
    network = circuit(delta.astype(complex), [[0, 0, 0], [1, 1, 1], [2, 2, 2]])
    dynamics = Dynamics(network, tuple(single(GFM_D, phase) for phase in "ABC"), 0.002)
    dynamics.start(np.zeros(3), np.zeros(3))
    before = dynamics.readings().copy()

    out = dynamics.run(500)[-1]

    assert network.components()[0] == 1
    assert np.ptp(before[:, 1]) > 0.05 * S_B
    np.testing.assert_allclose(out[:, :4], before, rtol=1e-9, atol=1e-6)


def test_it_starts_its_de_energised_lateral_at_its_own_phase() -> None:
    """A black start on phase C begins at +120 degrees, so that the lateral meets the rest in step."""
    network = circuit(np.array([[0.5 / Z_B]], complex), [[0, 0, 0]])
    dynamics = Dynamics(network, (single(GFM_D, "C"),), 0.002, connected=[False])
    dynamics.inverters.set_points[0] = 0.0, 1.0, 0.0
    dynamics.connect(network)
    dynamics.switch_inverters([0], True)
    dynamics.run(1)

    assert np.degrees(np.angle(dynamics.inverters.V[0, 0])) == pytest.approx(120.0, abs=6.0)


def test_its_available_power_is_of_its_own_rating() -> None:
    """A bound of half of its rating in watts is half of its P reference."""
    stiff = circuit(np.zeros((3, 3), complex), [[1, 1, 1]], source=V_B * BALANCED)
    dynamics = Dynamics(stiff, (single(GFL_D, "B"),), 0.002)
    dynamics.start(np.array([0.9]), np.zeros(1))
    dynamics.inverters.limit_power(0, 0.5 * S_B / 3.0)

    P = dynamics.run(2000)[-1, 0, 1]

    assert pytest.approx(0.5 * S_B / 3.0, rel=1e-6) == P
