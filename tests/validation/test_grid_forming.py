"""Part (d) of docs/validation.md: a grid-forming source beside OpenDSS's."""

import pytest

from bench.validation.grid_forming import GRID_FORMING
from tests.validation.limits_kept import assert_limits_kept


@pytest.mark.parametrize("case", GRID_FORMING.cases)
def test_an_island_behind_a_grid_forming_source_is_opendss_s(case: str) -> None:
    """All phasors and the source's power are both engines' within 1e-6 pu, as far as OpenDSS's model goes."""
    result = assert_limits_kept(GRID_FORMING, case)

    assert result.facts["nodes with voltage"] == ("166 of 216" if case in ("shed", "regulated") else "216 of 216")
