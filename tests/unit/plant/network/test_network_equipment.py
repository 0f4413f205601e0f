from typing import Any

import numpy as np
import pytest

from gridpeers.plant.equipment import Line, LineConfig, Transformer
from gridpeers.plant.network import Network
from tests.unit.plant.networks import diagonal, feeder, three_phase_bus


def test_lines_without_charging_carry_no_current_at_equal_voltages() -> None:
    """A line's series admittance sees only voltage differences; with charging, half its capacitance is at each end."""
    config = LineConfig(
        name="c",
        phases="ABC",
        Z=diagonal(0.3 + 0.9j),
        B=diagonal(4e-6),
    )
    line = Line(name="l", from_bus="1", to_bus="2", phases="AC", config="c", length=2.0)
    table = feeder(buses=(three_phase_bus("1"), three_phase_bus("2")), lines=(line,), line_configs=(config,))
    V = np.full(6, 2400.0 + 0j)

    bare, charged = (Network(table, line_charging=charging).Y_branches @ V for charging in (False, True))

    np.testing.assert_allclose(bare, 0.0, atol=1e-9)
    np.testing.assert_allclose(charged, 2400.0 * 4e-6j * np.array([1, 0, 1, 1, 0, 1]), atol=1e-9)


@pytest.mark.parametrize("connection", ["D-D", "Yg-Yg"])
def test_transformer_impedance_and_ratio(connection: Any) -> None:
    """Short-circuited at its secondary, a transformer draws 1/z of its rated current; open, it has its ratio."""
    z = 0.0127 + 0.0272j
    transformer = Transformer(name="t", from_bus="1", to_bus="2", connection=connection, S_rated=150e3, z=z)
    network = Network(
        feeder(buses=(three_phase_bus("1", 2400.0), three_phase_bus("2", 240.0)), transformers=(transformer,))
    )
    Y = network.Y_branches.toarray()
    V = network.nominal[:3]

    short_circuit = Y[:3, :3] @ V
    open_secondary = -np.linalg.solve(Y[3:, 3:], Y[3:, :3] @ V)

    np.testing.assert_allclose(short_circuit, V / 2400.0 * 150e3 / (3 * 2400.0) / z, rtol=1e-12)
    np.testing.assert_allclose(open_secondary, V / 10.0, rtol=1e-12)


def test_delta_transformer_passes_no_zero_sequence() -> None:
    """A voltage common to all phases drives no current through a delta winding."""
    transformer = Transformer(name="t", from_bus="1", to_bus="2", connection="D-D", S_rated=150e3, z=0.01 + 0.03j)
    network = Network(feeder(buses=(three_phase_bus("1"), three_phase_bus("2")), transformers=(transformer,)))

    current = network.Y_branches @ np.array([1000.0, 1000.0, 1000.0, 0.0, 0.0, 0.0])

    np.testing.assert_allclose(current, 0.0, atol=1e-9)


def test_capacitors_give_their_reactive_power_at_rated_voltage(network: Network) -> None:
    """The banks of the feeder give 750 kvar together at their rated voltage."""
    V = network.nominal * 2401.8 / (4160 / 3**0.5)

    assert V @ np.conj(network.Y_capacitors @ V) == pytest.approx(-750e3j)
