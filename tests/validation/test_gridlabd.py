"""Part (b) of docs/validation.md: the plant beside GridLAB-D, in a fifth of the page's time."""

import pytest

from bench.validation.both_plants import GRIDLABD
from bench.validation.gridlabd_runs import RUNS
from tests.validation.limits_kept import assert_limits_kept


@pytest.mark.parametrize("case", [name for name, run in RUNS.items() if run.in_tests])
def test_the_plant_goes_through_a_run_as_gridlabd_does(case: str) -> None:
    """With set-points from a list and from agents, f, P, Q and V of all inverters are GridLAB-D's at each step."""
    assert_limits_kept(GRIDLABD, case)
