"""Part (a) of docs/validation.md: the power flow beside both OpenDSS engines."""

import pytest

from bench.validation.power_flow import POWER_FLOW, SWITCH_STATES
from tests.validation.limits_kept import assert_limits_kept


@pytest.mark.parametrize("case", POWER_FLOW.cases)
def test_the_power_flow_is_that_of_both_opendss_engines(case: str) -> None:
    """Every node's phasor of the IEEE 13, 34 and 123-node feeders and of ours is both engines' within 1e-6 pu."""
    result = assert_limits_kept(POWER_FLOW, case)

    if case == SWITCH_STATES:
        assert result.facts["states"].startswith("652 of 1024,")
