"""The sparse form of a large network, beside the dense one of a small network."""

from __future__ import annotations

import numpy as np
import pytest

from plant.dynamics import reduce_network
from plant.feeder import Plant
from plant.network import Network
from plant.plant_config import Method, PlantSettings, SwitchEvent
from plant.tables import read_feeder

EVENTS = (
    SwitchEvent(t=0.1, switch="13-152", action="open"),
    SwitchEvent(t=0.3, switch="60-160", action="open"),
    SwitchEvent(t=0.5, switch="60-160", action="close"),
)


def rows(
    monkeypatch: pytest.MonkeyPatch, most_dense: int, method: Method
) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Return what is recorded of the microgrid feeder through its switchings, solved in one form."""
    monkeypatch.setattr(reduce_network, "MOST_DENSE", most_dense)
    plant = Plant(Network(read_feeder("microgrid123")), PlantSettings(events=EVENTS, method=method), 0.02, 0.02)
    for _ in range(40):
        plant.advance()
    return np.array(plant.take_rows())


@pytest.mark.parametrize("method", ["first-order", "second-order"])
def test_both_forms_give_the_same_run(monkeypatch: pytest.MonkeyPatch, method: Method) -> None:
    """Frequency, powers and voltages through islanding, load loss and reclosing differ by rounding alone."""
    np.testing.assert_allclose(rows(monkeypatch, 0, method), rows(monkeypatch, 10_000, method), rtol=1e-9, atol=1e-3)
