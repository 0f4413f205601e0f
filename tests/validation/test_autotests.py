"""Part (c) of docs/validation.md: GridLAB-D's autotests."""

import pytest

from bench.validation.autotests import AUTOTESTS
from bench.validation.secondary_feeder import island_tables
from gridpeers.plant.tables import read_feeder
from tests.validation.limits_kept import assert_limits_kept

STEPS = {"gfm-gfl": "2000", "secondary-start": "610"}


@pytest.mark.parametrize("case", STEPS)
def test_the_plant_runs_gridlabds_autotests_as_gridlabd_does(case: str) -> None:
    """Power of every source within 0.01 VA and frequency within 1e-8 Hz, after every step; control acts three times."""
    result = assert_limits_kept(AUTOTESTS, case)

    assert result.facts["steps"] == STEPS[case]


def test_the_impedances_of_the_autotest_are_the_published_ones() -> None:
    """Configurations 1 and 3 to 8 of IEEE 123 have the four digits (ohm a mile) that are published; others differ."""
    published = {config.name: config for config in read_feeder("standard123").line_configs}

    for row in island_tables()["line_configs"]:
        if row["config"] in "1345678":
            config = published[row["config"]]
            i, j = (config.phases.index(row[end]) for end in ("phase_1", "phase_2"))
            Z = complex(float(row["R_ohm_per_km"]), float(row["X_ohm_per_km"]))
            assert pytest.approx(config.Z[i][j] * 1.609344, abs=1e-4) == Z * 1.609344
