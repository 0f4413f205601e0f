"""A feeder that is written and read again is the same feeder."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gridpeers.feeder import Feeder
from plant.network import Network, solve_power_flow


@pytest.mark.parametrize("name", ["microgrid123", "standard123"])
def test_own_tables_survive_writing(name: str, tmp_path: Path) -> None:
    """Every table of ours keeps its rows; the voltages agree to rounding."""
    feeder = Feeder.read(name)
    again = Feeder.read(feeder.save(tmp_path / name))

    for field in ("lines", "line_configs", "switches", "loads", "capacitors", "regulators", "transformers"):
        assert len(getattr(again, field)) == len(getattr(feeder, field)), field
    assert [bus.name for bus in again.buses] == [bus.name for bus in feeder.buses]
    assert (again.inverters, again.spares, again.source) == (feeder.inverters, feeder.spares, feeder.source)
    one, other = (Network(each) for each in (feeder, again))
    V, W = (solve_power_flow(network, network.closed0).V for network in (one, other))
    np.testing.assert_allclose(W, V, rtol=1e-11)


def test_an_inverter_added_to_a_feeder_of_ours_is_saved(tmp_path: Path) -> None:
    """What `add_inverter` returns can be named by a scenario, once it is saved."""
    feeder = Feeder.read("microgrid123").add_inverter("inv11", bus="87", kind="GFL", P_rated=2e5)

    assert Feeder.read(feeder.save(tmp_path / "mine")).inverters == feeder.inverters
