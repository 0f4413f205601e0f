"""The headline: what the count of near numbers leaves out stands beside it."""

from dataclasses import replace

from gridpeers.papers.singhal2022.paper_benchmarks import headline, numbers
from gridpeers.papers.singhal2022.tables import tables_of
from gridpeers.scenarios.results.findings import Findings
from gridpeers.scenarios.results.metrics import Steady


def told(case: str, event: str, **ours: float) -> list[str]:
    """The headline of the islanding with one number that is not the paper's."""
    values: dict[str, dict[str, dict[str, float]]] = {}
    for table in tables_of("islanding"):
        for cell in table.cells:
            values.setdefault(cell.case, {}).setdefault(cell.event, {})[cell.quantity] = cell.paper
    results = {
        name: {label: Steady(**cells, t_restore_s=None, p={}) for label, cells in events.items()}
        for name, events in values.items()
    }
    results[case][event] = replace(results[case][event], **ours)
    return headline(numbers(Findings(results=results), tables_of("islanding")))


def test_the_numbers_that_no_tolerance_judges_are_counted_and_the_farthest_is_named() -> None:
    """A third of the paper's MQSI is no difference of any claim, and is told as beyond a factor of 2."""
    assert told("IV", "event1", MQSI=0.0133)[1] == (
        "The other 8, all MQSI of Table II, are not judged by a tolerance: they are 0.33 to 1 times the paper's, "
        "7 of 8 within a factor of 2; farthest off: 0.013 for 0.04 (Table II, case IV, event1)."
    )


def test_a_V_error_of_zero_is_far_from_one_that_is_small() -> None:
    """0 for 0.001 is within 0.003 pu, and not within a quarter of 0.001 or half of its last digit."""
    lines = told("IV", "event2", V_error=0.0)

    assert lines[0] == "24 of the 24 numbers of Tables I and II that are judged by a tolerance are within it."
    assert lines[2].startswith("V_error beside its own size: 7 of 8 within 25 %")
    assert lines[2].endswith("farthest off: 0.0000 for 0.001 (Table II, case IV, event2).")


def test_what_is_not_steady_is_farther_off_than_any_number() -> None:
    """It counts as not near, and its place is named."""
    lines = told("II", "event1", reasons={"MQSI": "not steady: it grows"})  # type: ignore[arg-type]

    assert "7 of 8 within a factor of 2; farthest off: not steady for 2.03 (Table II, case II, event1)." in lines[1]


def test_a_scenario_without_tables_has_no_headline() -> None:
    """Nothing is counted where there is nothing of the paper's."""
    assert headline(numbers(Findings(results={}), ())) == []
