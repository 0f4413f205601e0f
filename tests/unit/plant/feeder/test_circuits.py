import numpy as np
import pytest

from gridpeers.plant.dynamics import PlantError
from gridpeers.plant.equipment import InverterRow, Load, Regulator, Switch
from gridpeers.plant.feeder.circuits import Circuits
from gridpeers.plant.network import Network
from tests.unit.plant.networks import PAPER_ISLANDS, feeder, opened, three_phase_bus


def inverter(name: str, bus: str) -> InverterRow:
    """A GFM at a bus."""
    return InverterRow(name=name, kind="GFM", bus=bus, microgrid="MG1", P_rated=600e3, V_nom=2400.0, m_p=0.01, m_q=0.05)


def test_branches_see_the_voltages_of_their_loads() -> None:
    """The incidence gives every load branch the voltage across its load, behind a regulator too."""
    S = (30e3 + 10e3j, 20e3 + 5e3j, 0j)
    network = Network(
        feeder(
            buses=(three_phase_bus("1"), three_phase_bus("2")),
            regulators=(Regulator(name="r", from_bus="1", to_bus="2", phases="AB", ratio=1.05),),
            loads=(
                Load(bus="1", connection="Y", model="P", S=S),
                Load(bus="2", connection="Y", model="I", S=S),
                Load(bus="2", connection="D", model="P", S=S),
            ),
        )
    )
    circuit, merge = Circuits(network).of(frozenset()), network.merge(frozenset())
    V = network.nominal * np.linspace(0.9, 1.1, len(network.nodes))

    across = circuit.C.T @ V

    at_1, at_2 = merge.expand(V)[:3], merge.expand(V)[3:]
    np.testing.assert_allclose(across, [at_1[0], at_1[1], at_2[0], at_2[1], at_2[0] - at_2[1], at_2[1] - at_2[2]])
    assert abs(at_2[0] / at_1[0]) == pytest.approx(1.05)
    np.testing.assert_allclose(np.abs(circuit.V_branch), 2400.0 * np.array([1, 1, 1, 1, 3**0.5, 3**0.5]))


def test_terminals_are_where_the_inverters_stand(network: Network) -> None:
    """Terminals come in the inverters' order, phases A, B, C, whatever is merged with them."""
    circuit = Circuits(network).of(network.closed0)

    assert [[network.nodes[i] for i in row] for row in circuit.terminals] == [
        [(unit.bus, phase) for phase in "ABC"] for unit in network.inverters
    ]


def test_a_switch_state_has_one_circuit(network: Network) -> None:
    """Coming back to a switch state gives the very circuit it had, so its factors are found again."""
    circuits = Circuits(network)
    first = circuits.of(network.closed0)

    assert circuits.of(opened(network, *PAPER_ISLANDS)) is not first
    assert circuits.of(frozenset(set(network.closed0))) is first


def test_inverters_tied_without_impedance_are_refused() -> None:
    """A closed switch between two inverters leaves their sharing undecided, and the error names both."""
    network = Network(
        feeder(
            buses=(three_phase_bus("1"), three_phase_bus("2")),
            switches=(Switch(name="1-2", alias="", from_bus="1", to_bus="2", phases="ABC", closed=True),),
            inverters=(inverter("inv1", "1"), inverter("inv2", "2")),
        )
    )

    with pytest.raises(PlantError, match="inv2 at bus 2 is tied to inv1 by closed switches"):
        Circuits(network).of(network.closed0)
    assert len(Circuits(network).of(frozenset()).terminals) == 2
