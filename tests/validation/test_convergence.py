"""Part (e) of docs/validation.md: both methods beside the integrated equations, the islanding alone."""

import numpy as np
import pytest

from bench.validation.convergence import CONVERGENCE
from bench.validation.reference_dynamics import DaeDynamics
from tests.unit.plant.dynamics.circuits import GFL_D, GFM_D, inverter
from tests.unit.plant.dynamics.test_single_phase import pair_of, single
from tests.validation.limits_kept import assert_limits_kept


@pytest.mark.parametrize("case", CONVERGENCE.cases)
def test_the_error_falls_with_the_order_of_the_method(case: str) -> None:
    """First and second order; at 2 ms the second errs less than the first at 0.25 ms; its limit is scipy's."""
    assert_limits_kept(CONVERGENCE, case)


def test_the_reference_refuses_what_its_equations_do_not_have() -> None:
    """A single-phase inverter, and one that is off, are errors: neither is integrated as something else."""
    on_one_phase = DaeDynamics(pair_of(1, 0.8), (single(GFM_D, "B"), single(GFL_D, "B")), 0.002)
    on_one_phase.start(np.array([0.0, 0.4]), np.zeros(2))
    one_off = DaeDynamics(pair_of(3, 0.8), (inverter(GFM_D), inverter(GFL_D)), 0.002)
    one_off.start(np.array([0.0, 0.4]), np.zeros(2))
    one_off.switch_inverter(1, on=False)

    with pytest.raises(RuntimeError, match="the reference has no single-phase inverter"):
        on_one_phase.run(1)
    with pytest.raises(RuntimeError, match="the reference has no inverter that is off"):
        one_off.run(1)
