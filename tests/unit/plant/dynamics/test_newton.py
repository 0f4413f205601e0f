"""Islands near their largest load: Newton's method, current limits, and islands that do not settle."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import scipy.sparse as sp
from msgspec.structs import replace

from gridpeers.plant.dynamics import Circuit, Dynamics, PlantError
from gridpeers.plant.dynamics.circuit import LoadLaw
from gridpeers.plant.dynamics.island_newton import Island, solve_island
from gridpeers.plant.dynamics.kernel.compiled import Complex
from gridpeers.plant.dynamics.live_network import unsettled_island
from gridpeers.plant.feeder import Plant
from gridpeers.plant.inverters.gfm_droop import GfmDroop
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings, Protection, SwitchEvent
from gridpeers.plant.tables import read_feeder
from tests.unit.plant.dynamics.circuits import BALANCED, GFM_D, S_B, V_B, Z_B, circuit, inverter, loaded, lone

X, E = 0.5, 240.0


def voltage_of(P: float, E_0: complex, guess: complex) -> Complex | None:
    """Voltage (V) of one load of constant power P (W) behind a reactance X (ohm) and a source E_0 (V)."""
    load = LoadLaw(S=np.array([P + 0j]), I0=np.zeros(1, complex))
    y = 1.0 / (1j * X)
    island = Island(sp.csc_array([[y]]), sp.csc_array([[1.0]]), load)
    return solve_island(island, np.zeros(1, complex), np.array([E_0 * y]), np.array([guess]))


@pytest.mark.parametrize("part", [0.1, 0.9, 0.999])
@pytest.mark.parametrize("guess", [1.0, 0.3, 0.01])
def test_a_load_behind_a_reactance_has_the_textbook_voltage(part: float, guess: float) -> None:
    """|V|^2 = E^2/2 + sqrt(E^4/4 - X^2 P^2), the higher of both solutions, also from a guess near the lower one."""
    P = part * E**2 / (2.0 * X)

    V = voltage_of(P, E, guess * E)

    assert V is not None
    assert abs(V[0]) ** 2 == pytest.approx(E**2 / 2.0 + np.sqrt(E**4 / 4.0 - (X * P) ** 2), rel=1e-9)


@pytest.mark.parametrize("part", [1.001, 2.0, 100.0])
def test_more_than_the_largest_load_has_no_solution(part: float) -> None:
    """Beyond E^2 / 2X the solver reports no solution."""
    assert voltage_of(part * E**2 / (2.0 * X), E, E) is None


@pytest.mark.parametrize("B", [1e3, 1e5, 1e7])
def test_a_load_behind_next_to_no_impedance_has_the_textbook_voltage(B: float) -> None:
    """A susceptance of 1e7 S before the load, as of a switch, leaves rounding in every step: that is a solution."""
    P, X_all, y = 0.7 * E**2 / (2.0 * X), X + 1.0 / B, -1j * B
    load = LoadLaw(S=np.array([P + 0j]), I0=np.zeros(1, complex))
    Y = sp.csc_array(np.array([[y + 1.0 / (1j * X), -y], [-y, y]]))
    right = np.array([E / (1j * X), 0.0])
    island = Island(Y, sp.csc_array([[0.0], [1.0]]), load)

    V = solve_island(island, np.zeros(1, complex), right, right)

    assert V is not None
    assert abs(V[1]) ** 2 == pytest.approx(E**2 / 2.0 + np.sqrt(E**4 / 4.0 - (X_all * P) ** 2), rel=1e-7)


def test_injections_that_are_not_finite_have_no_solution() -> None:
    """They give no voltages."""
    assert voltage_of(1e3, complex("nan"), E) is None


ISLANDS = 3


def lone_islands(I_max: float) -> Dynamics:
    """Three GFM, each alone with constant power of 0.3 pu, at rest."""
    n = 3 * ISLANDS
    circuit = Circuit(
        Y=sp.csc_array(0.01 * np.eye(n) / Z_B),
        sources=np.arange(0),
        source_voltage=np.zeros(0, complex),
        terminals=np.arange(n).reshape(ISLANDS, 3),
        C=sp.csc_array(np.eye(n)),
        loads=LoadLaw(S=np.full(n, 0.3 * S_B / 3.0 + 0j), I0=np.zeros(n, complex)),
        V_branch=V_B * np.tile(BALANCED, ISLANDS),
    )
    dynamics = Dynamics(circuit, (inverter(replace(GFM_D, I_max=I_max)),) * ISLANDS, 0.002)
    dynamics.start(np.full(ISLANDS, 0.3), np.zeros(ISLANDS))
    dynamics.run(5)
    return dynamics


@pytest.mark.parametrize("island", [1])
@pytest.mark.parametrize(("load", "I_max"), [(8.0, 1000.0), (2.0, 1.2)], ids=["collapse", "limit"])
def test_the_island_with_more_load_than_it_can_carry_is_found(island: int, load: float, I_max: float) -> None:
    """Among three live islands it is the one whose load has no solution, by its voltages or by its current limit."""
    dynamics = lone_islands(I_max)
    net, here = dynamics.network.net, dynamics.network.net.branch_island == island
    assert here.any()
    net.S[here] *= load / 0.3

    assert unsettled_island(net, dynamics.arrays(), dynamics.network.x, 1e-11 * V_B) == island


I_B = S_B / (3.0 * V_B)


def test_an_overloaded_phase_carries_its_limit_and_the_others_their_load() -> None:
    """With a load of 3 pu on phase A, |I_A| stays below I_max and V_A is what that gives; B and C stay as they are."""
    dynamics = lone(replace(GFM_D, I_max=1.2), 0.5)
    dynamics.connect(circuit(np.diag([3.0, 0.5, 0.5]).astype(complex) / Z_B, [[0, 1, 2]]))

    out = dynamics.run(1)
    current, V = np.abs(dynamics.inverters.I[0]) / I_B, np.abs(dynamics.inverters.V[0]) / V_B

    assert 0.5 < current[0] <= 1.2 + 1e-9
    assert V[0] == pytest.approx(current[0] / 3.0, abs=1e-9)
    assert current[1:] == pytest.approx([0.5, 0.5], abs=0.01)
    assert out[0, 0, 6] == 1.0


def test_the_controller_goes_on_unlimited_once_the_overload_ends() -> None:
    """The limit leaves no trace in the injection: without overload the next step has full voltage again."""
    dynamics = lone(replace(GFM_D, I_max=1.2), 0.5)
    dynamics.connect(loaded(3.0))
    dynamics.run(1)
    dynamics.connect(loaded(0.5))

    out = dynamics.run(1)

    assert out[0, 0, 6] == 0.0
    assert out[0, 0, 3] / V_B > 0.9


def unequal(*P: float) -> Circuit:
    """One terminal and, behind lines, constant power (pu) on each phase, which gives way below 0.7 pu."""
    y, one = 20.0 / Z_B, np.eye(3)
    rows = [(part * S_B / 3.0, 0.45 * part * S_B / 3.0, V_B, 0, 0, 0.5 * V_B, 0.7 * V_B, 0, 0, 0, 0) for part in P]
    loads = LoadLaw(S=np.zeros(3, complex), I0=np.zeros(3, complex), limited_at=np.arange(3), law=np.array(rows, float))
    behind = sp.csc_array(np.vstack([0.0 * one, one]))
    lines = circuit(np.kron([[y, -y], [-y, y]], one).astype(complex), [[0, 1, 2]])
    return dataclasses.replace(lines, C=behind, loads=loads, V_branch=V_B * BALANCED)


def test_an_island_whose_limited_currents_settle_is_not_de_energised() -> None:
    """Two phases fall to voltages at which loads draw less, and stay at their limit, far from the tangent."""
    dynamics = Dynamics(unequal(0.3, 0.8, 0.9), (inverter(replace(GFM_D, I_max=1.5)),), 0.002)
    dynamics.start(np.array([0.6]), np.zeros(1))
    dynamics.connect(unequal(0.3, 1.2, 1.6))

    dynamics.run(20)
    current, V = np.abs(dynamics.inverters.I[0]) / I_B, np.abs(dynamics.inverters.V[0]) / V_B

    assert dynamics.take_trips() == []
    assert current[1:] == pytest.approx([1.5, 1.5], abs=0.01)
    assert V[0] > 1.0
    assert (V[1:] < 0.75).all()


def test_a_limit_that_does_not_act_changes_no_number() -> None:
    """The same bytes with 2 pu and with 1000 pu, through an islanding in which phases reach 1.9 pu."""

    def rows(I_max: float) -> tuple[tuple[float, ...], ...]:
        return islanded(I_max).take_rows()

    assert rows(2.0) == rows(1000.0)


def islanded(I_max: float) -> Plant:
    settings = PlantSettings(
        gfm=GfmDroop(I_max=I_max),
        protection=Protection(category="off"),
        events=(SwitchEvent(t=0.02, switch="13-152", action="open"),),
    )
    plant = Plant(Network(read_feeder("microgrid123")), settings, 0.02, 0.002)
    for _ in range(6):
        plant.advance()
    return plant


def test_limiting_is_an_event_once_a_spell() -> None:
    """An inverter that limits in many steps says so once, with its limit."""
    events = [event for event in islanded(1.7).take_events() if event.kind == "limit"]

    assert events
    assert len({event.subject for event in events}) == len(events)
    assert events[0].text == f"{events[0].subject} limits its phase currents to 1.7 pu"


def test_a_start_beyond_the_limit_is_refused() -> None:
    """At rest no phase may be beyond its limit; the error says the currents and what to change."""
    settings = PlantSettings(gfm=GfmDroop(I_max=0.6))

    with pytest.raises(PlantError, match=r"inv1 needs \d+(\.\d+)? A in a phase; .*I_max_pu"):
        Plant(Network(read_feeder("microgrid123")), settings, 0.02, 0.02)
