"""What docs/hostile.md says of the scenario hostile, by its pinned histories."""

from tests.golden.catalogue.pins import read

PINS = read().pins


def f_error(case: str) -> float:
    """Frequency error (Hz) of the first inverter at the end of a case."""
    return abs(PINS["hostile", case].last[0] - 60.0)


def test_one_liar_holds_the_frequency_of_the_paper_s_law_off_nominal() -> None:
    """Five times the band of 0.01 Hz, with all values plausible in form; a small lie does it too, past plausibility."""
    assert f_error("truth") < 1e-4
    assert f_error("one") > 0.05
    assert f_error("small") > 0.03


def test_each_defence_stops_what_it_is_made_for_and_no_more() -> None:
    """Plausibility stops a large lie; W-MSR stops F liars on a robust graph, not F + 1, and not on the sparse graph."""
    assert max(f_error(case) for case in ("plausible", "trimmed", "two-trimmed")) < 1e-3
    assert f_error("two") > 0.05
    assert f_error("sparse") > 0.05
