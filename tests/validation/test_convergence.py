"""Part (e) of docs/validation.md: both methods beside the integrated equations, the islanding alone."""

import pytest

from bench.validation.convergence_part import CONVERGENCE
from tests.validation.limits_kept import assert_limits_kept


@pytest.mark.parametrize("case", CONVERGENCE.cases)
def test_the_error_falls_with_the_order_of_the_method(case: str) -> None:
    """First and second order; at 2 ms the second errs less than the first at 0.25 ms; its limit is scipy's."""
    assert_limits_kept(CONVERGENCE, case)
