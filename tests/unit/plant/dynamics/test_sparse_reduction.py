"""The sparse form of a large network, beside the dense one of a small network."""

from __future__ import annotations

import numpy as np
import pytest

from gridpeers.plant.dynamics import live_network, power_flow_at_rest, reduction
from gridpeers.plant.dynamics.kernel.solve import NO_NETWORK
from gridpeers.plant.feeder import Plant
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import Method, PlantSettings, SwitchEvent
from gridpeers.plant.tables import read_feeder

EVENTS = (
    SwitchEvent(t=0.1, switch="13-152", action="open"),
    SwitchEvent(t=0.3, switch="60-160", action="open"),
    SwitchEvent(t=0.5, switch="60-160", action="close"),
)


def rows(
    monkeypatch: pytest.MonkeyPatch, most_dense: int, method: Method
) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Return what is recorded of the microgrid feeder through its switchings, solved in one form."""
    monkeypatch.setattr(reduction, "MOST_DENSE", most_dense)
    plant = Plant(Network(read_feeder("microgrid123")), PlantSettings(events=EVENTS, method=method), 0.02, 0.02)
    for _ in range(40):
        plant.advance()
    return np.array(plant.take_rows())


@pytest.mark.parametrize("method", ["first-order", "second-order"])
def test_both_forms_give_the_same_run(monkeypatch: pytest.MonkeyPatch, method: Method) -> None:
    """Frequency, powers and voltages through islanding, load loss and reclosing differ by rounding alone."""
    np.testing.assert_allclose(rows(monkeypatch, 0, method), rows(monkeypatch, 10_000, method), rtol=1e-9, atol=1e-3)


def test_a_tangent_that_is_renewed_gives_the_same_run_in_fewer_iterations(monkeypatch: pytest.MonkeyPatch) -> None:
    """After the islanding a tangent at the present voltages saves iterations, and moves nothing but rounding."""
    spent: list[int] = []
    refresh = live_network.LiveNetwork.refresh

    def counted(network: live_network.LiveNetwork, iterations: int, solutions: int) -> None:
        spent[-1] += iterations
        refresh(network, iterations, solutions)

    monkeypatch.setattr(live_network.LiveNetwork, "refresh", counted)
    runs = []
    for worth in (10**9, 40):
        monkeypatch.setattr(live_network, "WORTH", worth)
        spent.append(0)
        runs.append(rows(monkeypatch, 0, "first-order"))

    np.testing.assert_allclose(runs[0], runs[1], rtol=1e-9, atol=1e-3)
    assert spent[1] < 0.9 * spent[0]


def test_a_start_to_which_the_tangent_does_not_lead_is_found_by_newton(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the frozen tangent fails, e.g. across a limit of the loads' law, the operating point is the same."""
    plain, failures = rows(monkeypatch, 0, "first-order"), iter([True, False] * 3)
    settle = power_flow_at_rest.settle_powers
    monkeypatch.setattr(
        power_flow_at_rest,
        "settle_powers",
        lambda *words: (NO_NETWORK, 0.0) if next(failures, False) else settle(*words),
    )

    np.testing.assert_allclose(rows(monkeypatch, 0, "first-order"), plain, rtol=1e-9, atol=1e-3)
    assert not next(failures, False)
