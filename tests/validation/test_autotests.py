"""Part (c) of docs/validation.md: GridLAB-D's autotests."""

import pytest

from bench.validation.autotests_part import AUTOTESTS
from tests.validation.limits_kept import assert_limits_kept

STEPS = {"gfm-gfl": "2000", "secondary-start": "610"}


@pytest.mark.parametrize("case", STEPS)
def test_the_plant_runs_gridlabds_autotests_as_gridlabd_does(case: str) -> None:
    """Power of every source within 0.01 VA and frequency within 1e-8 Hz, after every step; control acts three times."""
    result = assert_limits_kept(AUTOTESTS, case)

    assert result.facts["steps"] == STEPS[case]
