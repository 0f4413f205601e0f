"""The start of a run: operating points, volt-var at rest, and inverters of balanced power."""

from __future__ import annotations

from itertools import product
from typing import Literal

import numpy as np
import pytest
from msgspec.structs import replace
from numpy.typing import NDArray

from gridpeers.plant.dynamics import Dynamics, power_flow_at_rest
from gridpeers.plant.dynamics.kernel.compiled import Real
from gridpeers.plant.dynamics.power_flow_at_rest import DROOP, INSIDE, MOST_ROUNDS, OVER, UNDER, VoltVarAtRest
from gridpeers.plant.feeder import Plant
from gridpeers.plant.inverters.gfl import Gfl
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings
from gridpeers.plant.tables import read_feeder
from tests.unit.plant.dynamics.circuits import BALANCED, GFL_D, S_B, V_B, Z_B, circuit, inverter, move_source


def start() -> Plant:
    return Plant(Network(read_feeder("microgrid123")), PlantSettings(), 0.02, 0.02)


def reactive_powers(plant: Plant) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return what the inverters deliver (pu)."""
    rated = np.array([unit.P_rated for unit in plant.network.inverters])
    Q = np.array([reading.Q for reading in plant.measure().values()]) / rated
    assert np.abs(Q).max() > 1e-3
    return Q


@pytest.mark.parametrize(("iterations", "methods"), [(20, ["krylov"]), (1, ["krylov", "hybr"])])
def test_many_inverters_start_where_few_do(
    monkeypatch: pytest.MonkeyPatch, iterations: int, methods: list[str]
) -> None:
    """Newton-Krylov, which many need, gives the Q of a full Jacobian, to 1e-10 pu; that decides where it fails."""
    few, taken = start(), []

    def noted(*arguments: object, **named: object) -> object:
        taken.append(named["method"])
        return root(*arguments, **named)

    root = power_flow_at_rest.root
    monkeypatch.setattr(power_flow_at_rest, "root", noted)
    monkeypatch.setattr(power_flow_at_rest, "MOST_BY_DIFFERENCES", 0)
    monkeypatch.setattr(power_flow_at_rest, "KRYLOV", power_flow_at_rest.KRYLOV | {"maxiter": iterations})
    many = start()

    assert taken == methods
    assert reactive_powers(many) == pytest.approx(reactive_powers(few), abs=1e-10)


VOLT_VAR = replace(GFL_D, volt_var=True, F_current=0.6, T_qf=0.1)
X, M_Q = 0.05, 0.05  # Reactance between the source and the inverter (pu), and the inverter's Q-V droop (pu per pu)


def started(parameters: Gfl, source: float, P: float = 0.0) -> Dynamics:
    """Start an inverter with V_set 1 pu behind a reactance X, at a source of so many pu."""
    y = 1.0 / (1j * X * Z_B)
    Y = np.kron(np.array([[y, -y], [-y, y]]), np.eye(3))
    network = circuit(Y, [[3, 4, 5]], source=source * V_B * BALANCED)
    dynamics = Dynamics(network, (inverter(parameters, m_q=M_Q),), 0.002)
    dynamics.start(np.array([P]), V_set=np.ones(1))
    return dynamics


def moved(dynamics: Dynamics) -> float:
    """Return how far f, P, Q and V go from those of the start within 2 s (Hz, W, var, V)."""
    start = dynamics.readings()
    return float(np.abs(dynamics.run(1000)[:, :, :4] - start).max())


def powers(dynamics: Dynamics) -> tuple[float, float]:
    """Return the inverter's voltage and reactive power (pu)."""
    S, v = dynamics.inverters.measured(dynamics.inverters.V, dynamics.inverters.I)
    return float(v[0]), float(S[0].imag)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("band", [0.0, 0.01])
def test_an_inverter_beyond_its_dead_band_starts_on_its_droop(band: float, sign: float) -> None:
    """Half of the source's deviation is left, twice the band of 0.01 pu: Q is (V_set - V) / m_q, and nothing moves."""
    dynamics = started(replace(VOLT_VAR, db_UV=band, db_OV=band), 1.0 - 0.03 * sign)
    v, q = powers(dynamics)

    assert q == pytest.approx((1.0 - v) / M_Q, abs=1e-10)
    assert sign * q == pytest.approx(0.3, abs=0.01)
    assert moved(dynamics) < 1e-4


@pytest.mark.parametrize(("low", "high", "vars"), [(0.1, 0.44, 0.1), (-0.44, -0.1, -0.1)])
@pytest.mark.parametrize("dead_band", ["gridlabd", "ieee1547"])
def test_an_inverter_within_its_dead_band_starts_within_its_limits(
    dead_band: Literal["gridlabd", "ieee1547"], low: float, high: float, vars: float
) -> None:
    """Limits of Q that exclude 0 hold within the band, too, so that nothing moves after the start."""
    limited = replace(VOLT_VAR, dead_band=dead_band, db_UV=0.02, db_OV=0.02, Q_min=low, Q_max=high)
    dynamics = started(limited, 1.0)

    assert powers(dynamics)[1] == pytest.approx(vars, abs=1e-9)
    assert moved(dynamics) < 1e-4


@pytest.mark.parametrize("source", [0.97, 1.03])
@pytest.mark.parametrize("parameters", [replace(VOLT_VAR, db_UV=0.04, db_OV=0.04), replace(VOLT_VAR, volt_var=False)])
def test_an_inverter_within_its_dead_band_starts_without_vars(parameters: Gfl, source: float) -> None:
    """Within the band, and without volt-var, Q is Q_set, 0: a start on the droop would move at once, by 0.3 pu."""
    dynamics = started(parameters, source, P=0.5)

    assert powers(dynamics)[1] == pytest.approx(0.0, abs=1e-12)
    assert dynamics.inverters.set_points[0, 1:].tolist() == [1.0, 0.0]
    assert moved(dynamics) < 1e-4


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_inverter_that_rests_nowhere_starts_on_the_edge_of_its_dead_band(sign: float) -> None:
    """Without vars V is beyond the band of 0.02 pu, with those of the droop within it: Q hunts around the start's."""
    dynamics = started(replace(VOLT_VAR, db_UV=0.02, db_OV=0.02), 1.0 - 0.03 * sign)
    v, q = powers(dynamics)
    Q = dynamics.run(2000)[:, 0, 2] / dynamics.inverters.S_b[0]

    assert v == pytest.approx(1.0 - 0.02 * sign, abs=1e-10)
    assert sign * q == pytest.approx(0.2, abs=0.01)
    assert Q[1000:].min() < q < Q[1000:].max()
    assert abs(Q[1000:].mean() - q) < 0.02


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("band", "most"), [(0.02, 10.0), (0.005, 10.0), (0.005, 0.1), (0.04, 10.0)])
def test_a_droop_from_the_edge_of_its_band_has_a_rest(band: float, most: float, sign: float) -> None:
    """Within the band there are no vars, beyond it those of the deviation from the edge; nothing hunts."""
    bands = replace(VOLT_VAR, db_UV=band, db_OV=band, dead_band="ieee1547", Q_max=most, Q_min=-most)
    dynamics = started(bands, 1.0 - 0.03 * sign)
    v, q = powers(dynamics)

    droop = max(abs(1.0 - v) - band, 0.0) / M_Q
    assert sign * q == pytest.approx(min(droop, most), abs=1e-9)
    assert (q == pytest.approx(0.0, abs=1e-12)) == (band > 0.03)
    assert dynamics.inverters.set_points[0, 1:].tolist() == [1.0, 0.0]
    assert moved(dynamics) < 1e-4


def test_an_inverter_at_its_limit_of_vars_keeps_its_set_point() -> None:
    """0.9 pu of P leave 0.44 pu of Q, where the droop asks for 1 pu: V_set stays 1 pu, and nothing moves."""
    dynamics = started(VOLT_VAR, 0.9, P=0.9)

    assert powers(dynamics)[1] == pytest.approx(np.sqrt(1.0 - 0.9**2), abs=1e-9)
    assert dynamics.inverters.set_points[0, 1] == 1.0
    assert moved(dynamics) < 1e-4


def test_there_is_one_rest_and_the_search_finds_it() -> None:
    """Of all ways to place four coupled inverters within, beyond and on the edges of their bands, one is a rest."""
    random = np.random.default_rng(1)
    for _ in range(40):
        inverters, v0, X = coupled(random)
        rests = []
        for place in map(np.array, product((DROOP, INSIDE, UNDER, OVER), repeat=v0.size)):
            if np.isinf(np.where(place == UNDER, inverters.db_UV, inverters.db_OV)[place >= UNDER]).any():
                continue
            v, Q = rest(inverters, v0, X, place)
            if np.array_equal(inverters.next_places(place, v, Q, 0), place):
                rests.append(Q)
        place, found = inverters.first_places(), None
        for rounds in range(MOST_ROUNDS):
            v, Q = rest(inverters, v0, X, place)
            before, place = place, inverters.next_places(place, v, Q, rounds)
            if np.array_equal(place, before):
                found = Q
                break

        assert len(rests) == 1
        assert found == pytest.approx(rests[0], abs=1e-12)


def coupled(random: np.random.Generator) -> tuple[VoltVarAtRest, Real, Real]:
    """Draw four inverters, their voltages without vars (pu), and what a Q raises each of them by (pu per pu)."""
    n = 4
    X = np.cov(random.normal(0.0, 0.3, (n, 6))) + np.diag(random.uniform(0.0, 0.02, n))
    below, above = random.choice([0.0, 0.005, 0.01, 0.03, np.inf], (2, n))
    no, most = np.zeros(n, bool), np.full(n, np.inf)
    inverters = VoltVarAtRest(np.ones(n), random.uniform(0.02, 0.1, n), below, above, no, -most, most)
    return inverters, 1.0 + random.normal(0.0, 0.03, n), X


def rest(inverters: VoltVarAtRest, v0: Real, X: Real, place: NDArray[np.int64]) -> tuple[Real, Real]:
    """Return v and Q (pu) with which inverters rest at these places."""
    own = np.diag(inverters.m_q)
    edge = np.where(place == UNDER, inverters.db_UV, -inverters.db_OV)
    A = np.where((place == DROOP)[:, None], own + X, np.where((place == INSIDE)[:, None], own, X))
    b = np.where(place == INSIDE, 0.0, inverters.V_set - v0 - np.where(place >= UNDER, edge, 0.0))
    Q = np.linalg.solve(A, b)
    return v0 + X @ Q, Q


UNEQUAL = V_B * BALANCED * np.array([1.0, 0.9, 1.05]) * np.exp(1j * np.radians([0.0, 4.0, -3.0]))
"""Unequal phase voltages, B and C off their angles (V)."""


def at_unequal_voltages(parameters: Gfl) -> Dynamics:
    """A GFL of 0.6 + j0.2 pu at a stiff bus of unequal phases, at rest."""
    bus = circuit(np.zeros((3, 3), complex), [[0, 1, 2]], source=UNEQUAL)
    dynamics = Dynamics(bus, (inverter(parameters),), 0.002)
    dynamics.start(np.array([0.6]), np.array([0.2]))
    return dynamics


@pytest.mark.parametrize("model", ["voltage_source", "current_source"])
def test_phases_of_unequal_voltage_deliver_equal_powers_at_rest(model: str) -> None:
    """Each phase gives a third of 0.6 + j0.2 pu from the start on, and nothing moves."""
    dynamics = at_unequal_voltages(replace(GFL_D, mode="balanced_power", model=model))
    dynamics.inverters.set_points[0, 2] = 0.2

    dynamics.run(500)
    powers = dynamics.inverters.V[0] * np.conj(dynamics.inverters.I[0]) / (S_B / 3.0)

    assert powers == pytest.approx(np.full(3, 0.6 + 0.2j), abs=1e-9)


def test_in_positive_sequence_the_currents_are_equal_instead() -> None:
    """The other mode drives the same current in all phases at the same voltages."""
    dynamics = at_unequal_voltages(GFL_D)

    dynamics.run(500)
    currents = np.abs(dynamics.inverters.I[0])

    assert currents == pytest.approx(np.full(3, currents[0]), rel=1e-9)


def test_a_power_step_reaches_every_phase_alike() -> None:
    """After a step of P the phases have a third of it each, whatever their voltages."""
    dynamics = at_unequal_voltages(replace(GFL_D, mode="balanced_power"))
    dynamics.inverters.hold(0, 0.9, 1.0)

    dynamics.run(2000)
    powers = dynamics.inverters.V[0] * np.conj(dynamics.inverters.I[0]) / (S_B / 3.0)

    assert powers.real == pytest.approx(np.full(3, 0.9), abs=1e-6)


def test_the_frequency_is_the_mean_of_the_three_plls() -> None:
    """A jump of phase B alone moves the reading by a third of what that PLL sees."""
    dynamics = at_unequal_voltages(replace(GFL_D, mode="balanced_power"))
    moved = UNEQUAL * np.exp(1j * np.array([0.0, 0.1, 0.0]))
    move_source(dynamics, moved)

    out = dynamics.run(1)
    k_p, k_i, u_B = 50.0, 900.0, 0.9
    first = u_B * np.sin(0.1)
    theta = 0.002 * (k_p + 0.002 * k_i) * first  # the predictor's angle; the corrector sees what remains
    second = u_B * np.sin(0.1 - theta)
    w = k_p * second + 0.001 * k_i * (first + second)

    assert out[0, 0, 0] - 60.0 == pytest.approx(w / 3.0 / (2.0 * np.pi), rel=1e-6)
