"""The parts of `python -m bench.validation`, each case with its limits."""

import pytest

from bench.validation.autotests import AUTOTESTS
from bench.validation.both_plants import GRIDLABD
from bench.validation.grid_forming import GRID_FORMING
from bench.validation.gridlabd_runs import RUNS
from bench.validation.power_flow import POWER_FLOW, SWITCH_STATES
from bench.validation.random_feeders import RANDOM_FEEDERS
from bench.validation.secondary_feeder import island_tables
from bench.validation.validation_part import CaseResult, ValidationPart
from gridpeers.plant.tables import read_feeder


def assert_limits_kept(part: ValidationPart, case: str) -> CaseResult:
    """Run a case and fail with every limit that it breaks; skip where a reference is not installed."""
    if missing := part.missing():
        pytest.skip(missing)
    result = (part.run_short or part.run)(case)
    assert result.broken() == []
    assert result.checks
    return result


# (a) the power flow beside both OpenDSS engines
@pytest.mark.parametrize("case", POWER_FLOW.cases)
def test_the_power_flow_equals_both_opendss_engines(case: str) -> None:
    """On the IEEE 13, 34 and 123-node feeders and on ours every phasor equals both engines' within 1e-6 pu."""
    result = assert_limits_kept(POWER_FLOW, case)

    if case == SWITCH_STATES:
        assert result.facts["states"].startswith("652 of 1024,")


# (b) the plant beside GridLAB-D, in a fifth of the time
@pytest.mark.parametrize("case", [name for name, run in RUNS.items() if run.in_tests])
def test_the_plant_equals_gridlabd_through_a_run(case: str) -> None:
    """f, P, Q and V of all inverters equal GridLAB-D's at each step, with set-points from a list or from agents."""
    assert_limits_kept(GRIDLABD, case)


# (c) GridLAB-D's autotests
STEPS = {"gfm-gfl": "2000", "secondary-start": "610"}


@pytest.mark.parametrize("case", STEPS)
def test_the_plant_equals_gridlabd_in_its_autotests(case: str) -> None:
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


# (d) a grid-forming source beside OpenDSS's
@pytest.mark.parametrize("case", GRID_FORMING.cases)
def test_an_island_behind_a_grid_forming_source_equals_opendss(case: str) -> None:
    """All phasors and the source's power equal both engines' within 1e-6 pu."""
    result = assert_limits_kept(GRID_FORMING, case)

    assert result.facts["nodes with voltage"] == ("166 of 216" if case in ("shed", "regulated") else "216 of 216")


# (f) random feeders beside both OpenDSS engines
@pytest.mark.parametrize("case", RANDOM_FEEDERS.cases)
def test_random_feeders_have_the_phasors_of_both_opendss_engines(case: str) -> None:
    """At the start, after a load step and after a switching; the currents at every node sum to zero."""
    result = assert_limits_kept(RANDOM_FEEDERS, case)

    assert int(result.facts["asymmetric"]) > 2
    assert int(result.facts["with an island"]) > 2
