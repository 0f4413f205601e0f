"""The error of both methods of time stepping beside the integrated equations, the islanding alone (validation.md)."""

import numpy as np
import pytest

from gridpeers.plant.plant_config import Method
from tests.unit.plant.dynamics.circuits import GFL_D, GFM_D, inverter
from tests.unit.plant.dynamics.test_single_phase import pair_of, single
from tests.validation.reference_dynamics import DaeDynamics
from tests.validation.step_errors import STEPS, step_errors

END = 0.3
"""Duration (s)."""

LEAST_ORDER = {"first-order": 0.8, "second-order": 1.7}
"""Least observed order of every quantity."""

ORDER_AT = {"first-order": (4, 5), "second-order": (2, 3)}
"""Places in `STEPS` that the order is taken between: small, but above the error of the reference in either method."""

AT_2_MS, AT_QUARTER, SMALLEST = STEPS.index(0.002), STEPS.index(0.00025), len(STEPS) - 1


@pytest.mark.parametrize("method", ["first-order", "second-order"])
def test_the_error_falls_with_the_order_of_the_method(method: Method) -> None:
    """Of every quantity, in closed loop."""
    errors = step_errors("IV", method, END)
    coarse, fine = ORDER_AT[method]

    order = np.log(errors[coarse] / errors[fine]) / np.log(STEPS[coarse] / STEPS[fine])

    assert order.min() >= LEAST_ORDER[method]


def test_the_second_order_method_errs_less_at_2_ms_than_the_default_at_a_quarter() -> None:
    """At most a fifth of the error (Hz, pu); and its limit at small steps is scipy's solution."""
    second, first = (step_errors("IV", method, END) for method in ("second-order", "first-order"))

    assert (second[AT_2_MS] / first[AT_QUARTER]).max() <= 0.2
    assert second[SMALLEST].max() <= 2e-5


def test_the_reference_refuses_what_its_equations_do_not_have() -> None:
    """A single-phase inverter, and one that is off, are errors: neither is integrated as something else."""
    on_one_phase = DaeDynamics(pair_of(1, 0.8), (single(GFM_D, "B"), single(GFL_D, "B")), 0.002)
    on_one_phase.start(np.array([0.0, 0.4]), np.zeros(2))
    one_off = DaeDynamics(pair_of(3, 0.8), (inverter(GFM_D), inverter(GFL_D)), 0.002)
    one_off.start(np.array([0.0, 0.4]), np.zeros(2))
    one_off.switch_inverters([1], False)

    with pytest.raises(RuntimeError, match="the reference has no single-phase inverter"):
        on_one_phase.run(1)
    with pytest.raises(RuntimeError, match="the reference has no inverter that is off"):
        one_off.run(1)
