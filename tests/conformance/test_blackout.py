"""A blackout and a black start, with agents: the run goes on, its events tell what happened, its numbers are true."""

import numpy as np
import pytest

from gridpeers.scenarios.results.event_windows import as_they_came, windows
from gridpeers.scenarios.results.history import History, Nameplates, history_of
from gridpeers.scenarios.results.metrics import measure
from gridpeers.scenarios.run_request import Outcome
from gridpeers.scenarios.schema import load_scenario
from tests.golden.catalogue.pins import ran


@pytest.fixture(scope="module")
def blackout() -> tuple[History, Outcome]:
    """Case IV of the catalogue's scenario."""
    recorded, outcome = ran("blackout", "IV")
    return history_of(recorded), outcome


def test_a_blackout_does_not_end_the_run(blackout: tuple[History, Outcome]) -> None:
    """The collapse, the island that is dead and the black start are events; the run is whole and reproducible."""
    history, outcome = blackout
    kinds = [event.kind for event in outcome.events]

    assert not outcome.broke
    assert outcome.reproducible
    assert history.t[-1] == 13.0
    assert kinds.index("trip") < kinds.index("dead")
    assert any(event.text.startswith("black start by inv1") for event in outcome.events)


def test_a_dead_island_reads_nothing_and_everything_in_the_history_is_finite(
    blackout: tuple[History, Outcome],
) -> None:
    """While nothing feeds the island, power, voltage and frequency are 0: not 60 Hz, not a number that is none."""
    history, _ = blackout
    dead = (history.t > 3.02) & (history.t < 9.0)

    for quantity in (history.f, history.P, history.Q, history.V):
        assert np.isfinite(quantity).all()
        assert not quantity[dead].any()


def test_metrics_are_finite_where_there_is_power_and_absent_where_there_is_none(
    blackout: tuple[History, Outcome],
) -> None:
    """Before the blackout and after the black start the paper's numbers hold; between there is nothing to measure."""
    history, outcome = blackout
    scenario, feeder = load_scenario("blackout")
    every = windows(as_they_came(scenario, outcome.events), scenario.time.end_s)
    found = {
        window.label: measure(window.cut(history), Nameplates.of(feeder.inverters), window, 60.0) for window in every
    }

    for label in ("islanding", "return"):
        steady = found[label]
        assert steady.f_error_Hz < 0.002
        assert steady.MPSI < 0.002
        assert steady.t_restore_s is not None
        assert steady.t_restore_s < 1.5
    for label in ("leave", "shedding"):
        assert np.isnan(found[label].f_error_Hz)
        assert found[label].t_restore_s is None
        assert found[label].t_load_s is None
        assert set(found[label].p.values()) == {0.0}
