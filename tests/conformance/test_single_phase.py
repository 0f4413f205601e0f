"""Agents of single-phase inverters: the law restores and shares, by either driver with the same bytes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import gridpeers as gp
from gridpeers.plant.tables.write import write_feeder
from tests.unit.plant.feeder.test_single_phase_inverters import small, unit

INVERTERS = (
    unit("inv1", "GFM", "2", "ABC", 250e3),
    unit("legA", "GFM", "3", "A", 40e3),
    unit("legC", "GFL", "3", "C", 30e3),
    unit("leg5", "GFM", "5", "B", 60e3),
    unit("roof", "GFL", "6", "B", 30e3),
)


@pytest.fixture
def islanded(tmp_path: Path) -> gp.Scenario:
    """A feeder of one three-phase and four single-phase inverters that loses the grid at 0.1 s."""
    write_feeder(small(*INVERTERS), tmp_path / "feeder")
    return gp.Scenario(
        name="single-phase",
        time={"end_s": 2.5},
        plant={"feeder": str(tmp_path / "feeder"), "load_set": "test", "P_set0_pu": 0.3},
        event=[{"label": "islanding", "t_s": 0.1, "open": ["grid"]}],
        case={"IV": {"secondary": "all", "graph": "full"}},
    )


def test_agents_restore_and_share_on_single_phases(islanded: gp.Scenario) -> None:
    """All reach 60 Hz with equal P in pu of their own ratings, on whichever phase; processes change no byte."""
    ran = islanded.run("IV")
    last = ran.history.iloc[-1]
    p = np.array([last[row.name, "P"] / row.P_rated for row in INVERTERS])
    f = np.array([last[row.name, "f"] for row in INVERTERS])

    assert np.abs(f - 60.0).max() < 2e-3
    assert np.ptp(p) < 2e-3
    assert p.mean() > 0.35
    assert islanded.run("IV", "processes").sha256 == ran.sha256


def test_what_gridlabd_cannot_do_with_single_phases_is_named_at_once(islanded: gp.Scenario) -> None:
    """It takes one inverter a bus, and keeps no island alive whose GFM are all single-phase."""
    with pytest.raises(ValueError, match="takes one inverter a bus") as refused:
        islanded.replace({"plant.simulator": "gridlabd", "event[0].open": ["grid", "lateral"]})

    assert 'bus "3" has legA, legC' in str(refused.value)
    assert 'event "islanding" leaves an island to leg5, and in GridLAB-D a GFM of three phases' in str(refused.value)
