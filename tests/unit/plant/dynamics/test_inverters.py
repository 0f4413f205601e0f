import numpy as np
import pytest

from gridpeers.plant.dynamics.inverters import Inverters
from tests.unit.plant.dynamics.circuits import GFL_D, GFM_D, S_B, inverter


@pytest.fixture
def units() -> Inverters:
    """A GFL, a GFM and another GFL."""
    return Inverters((inverter(GFL_D), inverter(GFM_D), inverter(GFL_D)), connected=(True, True, False))


def test_each_kind_has_its_own_records(units: Inverters) -> None:
    """Records and states of each kind are found at the inverters they belong to."""
    assert (units.gfm_at.tolist(), units.gfl_at.tolist()) == ([1], [0, 2])
    assert (len(units.gfm_state), len(units.gfl_state)) == (1, 2)
    assert units.y_f.tolist() == [units.gfl["y_f"][0], units.gfm["y_f"][0], units.gfl["y_f"][1]]
    assert units.S_max.tolist() == [1.0, np.inf, 1.0]
    assert units.connected.tolist() == [True, True, False]


def test_rest_is_that_of_the_inverter_asked_for(units: Inverters) -> None:
    """An inverter is set to rest by its place among all, and no other is touched."""
    units.J[1] = units.y_f[1] * units.V_b[1] * 1j
    units.rest(1, 0.2 + 0.1j, 1.01)
    units.rest(2, 0.4 + 0.3j, 0.98)

    assert units.theta() == pytest.approx([0.0, np.pi / 2.0, 0.0])
    assert (units.gfm_state["p"][0], units.gfm_state["q"][0], units.gfm_state["v"][0]) == (0.2, 0.1, 1.01)
    assert units.gfl_state["P_f"].tolist() == [0.0, 0.4]
    assert units.gfl_state["V_m"].tolist() == [0.0, 0.98]


def test_only_a_gfl_has_its_power_limited(units: Inverters) -> None:
    """A limit in W bounds one GFL's reference in pu; for a GFM it is refused by name."""
    units.limit_power(2, 0.25 * S_B)

    assert units.gfl["P_max"].tolist() == [GFL_D.P_max, 0.25]
    with pytest.raises(ValueError, match="GFM is grid-forming; only a GFL has a P reference"):
        units.limit_power(1, 0.25 * S_B)
