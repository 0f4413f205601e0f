"""The paper's experiments, each case run once for all tests of this folder."""

from dataclasses import dataclass

import pytest

from scenarios.drivers.inprocess import run_inprocess
from scenarios.results import metrics
from scenarios.results.claims import Start
from scenarios.results.history import History, Plates
from scenarios.results.metrics import Steady
from scenarios.spec import load_scenario
from scenarios.spec.configs import F_NOM, configs
from wire.messages import Telemetry


@dataclass(frozen=True)
class Experiment:
    """Results of all cases of one scenario."""

    plates: Plates
    histories: dict[str, History]
    steady: dict[str, dict[str, Steady]]
    start: Start


@pytest.fixture(scope="session")
def islanding() -> Experiment:
    """The paper's islanding experiment, by the driver without processes."""
    return experiment("islanding")


@pytest.fixture(scope="session")
def plug_n_play() -> Experiment:
    """The paper's plug-n-play experiment, by the driver without processes."""
    return experiment("plug-n-play")


def experiment(name: str) -> Experiment:
    """Run all cases of a scenario."""
    scenario, feeder = load_scenario(name)
    plates = Plates.of(feeder.inverters)
    windows = metrics.windows([(event.label, event.t_s) for event in scenario.events], scenario.time.end_s)
    histories, steady = {}, {}
    for case in scenario.cases:
        rows: list[tuple[float, ...]] = []

        def take(telemetry: Telemetry, rows: list[tuple[float, ...]] = rows) -> None:
            rows.extend(telemetry.rows)

        outcome = run_inprocess(*configs(scenario, feeder, case), take)
        assert not outcome.broke
        assert outcome.reproducible
        histories[case] = History.of(plates.names, rows)
        steady[case] = {w.label: metrics.measure(histories[case], plates, w, F_NOM) for w in windows}
    GFL = tuple(row.name for row in feeder.inverters if row.kind == "GFL")
    return Experiment(plates, histories, steady, Start(P_set0=scenario.plant.P_set0_pu, GFL=GFL))
