"""A blackout and a black start, with agents: the run goes on, its events tell what happened, its numbers are true."""

import numpy as np
import pytest
from msgspec.structs import replace

from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.results.event_windows import as_they_came, windows
from gridpeers.scenarios.results.history import History, Nameplates
from gridpeers.scenarios.results.metrics import measure
from gridpeers.scenarios.run_request import Outcome
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.configs import configs
from gridpeers.scenarios.schema.scenario_writing import to_toml
from gridpeers.wire.messages import Telemetry


@pytest.fixture(scope="module")
def blackout() -> tuple[History, Outcome]:
    """Run the catalogue's scenario once."""
    scenario, feeder = load_scenario("blackout")
    rows: list[tuple[float, ...]] = []

    def take(telemetry: Telemetry) -> None:
        rows.extend(telemetry.rows)

    outcome = run_inprocess(*configs(scenario, feeder, "IV"), take)
    return History.of(Nameplates.of(feeder.inverters).names, rows), outcome


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


def test_the_copy_of_a_scenario_keeps_its_protection(tmp_path_factory: pytest.TempPathFactory) -> None:
    """The scenario in a run's folder can be run again: settings are written as they are read."""
    scenario, _ = load_scenario("blackout")
    own = replace(scenario, protection=replace(scenario.protection, trips={"UV2": (0.4, 0.2), "OF1": (61.0, 100.0)}))
    path = tmp_path_factory.mktemp("copy") / "again.toml"
    path.write_text(to_toml(own, {}), encoding="utf-8")

    assert load_scenario(path)[0].protection == own.protection
