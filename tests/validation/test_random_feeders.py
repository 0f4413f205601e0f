"""Part (f) of docs/validation.md: random feeders beside both OpenDSS engines."""

import pytest

from bench.validation.random_feeders import RANDOM_FEEDERS
from tests.validation.limits_kept import assert_limits_kept


@pytest.mark.parametrize("case", RANDOM_FEEDERS.cases)
def test_random_feeders_have_the_phasors_of_both_opendss_engines(case: str) -> None:
    """At the start, after a load step and a switching, and no current is left at any node of the inner loop."""
    result = assert_limits_kept(RANDOM_FEEDERS, case)

    assert int(result.facts["asymmetric"]) > 2
    assert int(result.facts["with an island"]) > 2
