"""Part (b) of docs/validation.md, with agents: the plant beside GridLAB-D, in a fifth of the page's time."""

import pytest

from bench.validation.both_plants import GRIDLABD
from bench.validation.gridlabd_runs import RUNS
from tests.validation.limits_kept import assert_limits_kept


@pytest.mark.parametrize("case", [name for name, run in RUNS.items() if run.in_tests and run.closed_loop])
def test_agents_bring_the_plant_and_gridlabd_to_the_same_set_points(case: str) -> None:
    """Case IV, three islands and too little power: set-points, f, P, Q and V are the same in both in every step."""
    assert_limits_kept(GRIDLABD, case)
