"""The error of both methods of time stepping beside the integrated equations, the islanding alone (validation.md)."""

import numpy as np
import pytest

from gridpeers.plant.plant_config import Method
from tests.validation.step_errors import STEPS, step_errors

END = 0.3  # duration (s)
LEAST_ORDER = {"first-order": 0.8, "second-order": 1.7}  # least observed order of every quantity
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
