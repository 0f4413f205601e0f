"""Scenarios whose data differ from the paper's: 50 Hz, inverters without an agent, inverters chosen by name."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

import gridpeers as gp
from gridpeers.plant.tables.read import DATA
from gridpeers.plant.tables.write import write_feeder
from gridpeers.runs.result import Result
from gridpeers.scenarios.catalogue_files import CATALOGUE
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.measured_run import metrics_json
from gridpeers.scenarios.results.findings import find
from gridpeers.scenarios.results.history import Nameplates
from gridpeers.scenarios.results.record import Recorded, Recorder
from gridpeers.scenarios.run_request import Request
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.configs import configs
from tests.command_line import invoke
from tests.scenario_files import written
from tests.unit.plant.feeder.test_single_phase_inverters import small, unit

ISLANDING = (CATALOGUE / "islanding.toml").read_text(encoding="utf-8").replace('paper = "islanding"', "")


def recorded(path: Path, case: str) -> Recorded:
    scenario, feeder = load_scenario(path)
    recorder = Recorder()
    outcome = run_inprocess(*configs(scenario, feeder, case), recorder)
    assert not outcome.broke
    return recorder.finish(scenario.time.end_s, scenario.time.record_s)


def test_islanding_at_50_hz_settles_at_50_hz(tmp_path: Path) -> None:
    """The same feeder as 50 Hz equipment: on the grid at 50 Hz, restored to 50 Hz, with equal power, and no trip."""
    text = ISLANDING.replace("V_set0_pu = 1.0", "V_set0_pu = 1.0\nf_nom_Hz = 50.0").replace("7.0", "4.2")
    history = recorded(written(tmp_path, text), "IV").history
    _, feeder = load_scenario("islanding")
    before, after = history.t < 1.0, (history.t > 3.8) & (history.t < 4.0)
    share = history.P[after] / Nameplates.of(feeder.inverters).s

    assert np.abs(history.f[before] - 50.0).max() < 1e-6
    assert 0.05 < np.abs(history.f - 50.0).max() < 1.0
    assert np.abs(history.f[after] - 50.0).max() < 2e-3
    assert np.ptp(share, axis=1).max() < 5e-3


def test_a_feeder_says_its_own_nominal_frequency(tmp_path: Path) -> None:
    """`feeder.toml` of the feeder's folder; the scenario need not repeat it, and may override it."""
    folder = tmp_path / "european"
    shutil.copytree(DATA / "microgrid123", folder)
    (folder / "feeder.toml").write_text("f_nom_Hz = 50.0\n", encoding="utf-8")
    text = ISLANDING.replace('feeder = "microgrid123"', 'feeder = "european"')
    scenario, feeder = load_scenario(written(tmp_path, text))
    _, (agent, *_) = configs(scenario, feeder, "IV")
    override = written(tmp_path, text.replace("V_set0_pu = 1.0", "V_set0_pu = 1.0\nf_nom_Hz = 60.0"))

    assert (feeder.f_nom, agent.f_nom) == (50.0, 50.0)
    assert feeder.line_configs == load_scenario("islanding")[1].line_configs  # given at its own frequency
    assert load_scenario(override)[1].f_nom == 60.0


def test_an_inverter_without_agent_keeps_its_set_points_and_does_not_share(tmp_path: Path) -> None:
    """It stays on droop at 0.647 pu while the others share the rest; the numbers name the inverters that share."""
    text = ISLANDING.replace('secondary = "all"', 'secondary = "all"\nwithout_agent = ["inv2"]').replace("7.0", "4.2")
    path = written(tmp_path, text)
    scenario, feeder = load_scenario(path)
    case = CheckedCase.of(scenario, feeder, "IV", recorded(path, "IV"))
    found, history = find({"IV": case}), case.history
    steady = found.results["IV"]["event1"]
    ran = Request(scenario=scenario, feeder=feeder, driver="inprocess", folder=tmp_path)

    assert np.ptp(history.P_set[:, 1]) == 0.0
    assert steady.p["inv2"] == pytest.approx(0.647, abs=2e-3)
    assert min(p for name, p in steady.p.items() if name != "inv2") > 0.85
    assert steady.MPSI < 0.005
    assert '"without_agent": [\n        "inv2"\n      ]' in metrics_json(ran, found, {"IV": {}})


INVERTERS = (
    unit("inv1", "GFM", "2", "ABC", 250e3),
    unit("legA", "GFM", "3", "A", 40e3),
    unit("legC", "GFL", "3", "C", 30e3),
    unit("leg5", "GFM", "5", "B", 60e3),
    unit("roof", "GFL", "6", "B", 30e3),
)


@pytest.fixture
def islanded(tmp_path: Path) -> gp.Scenario:
    """A feeder of one three-phase and four single-phase inverters that loses the grid at 0.1 s."""
    write_feeder(small(*INVERTERS), tmp_path / "feeder")
    return gp.Scenario(
        name="single-phase",
        time={"end_s": 2.5},
        plant={"feeder": str(tmp_path / "feeder"), "load_set": "test", "P_set0_pu": 0.3},
        event=[{"label": "islanding", "t_s": 0.1, "open": ["grid"]}],
        case={"IV": {"secondary": "all", "graph": "full"}},
    )


def test_agents_restore_and_share_on_single_phases(islanded: gp.Scenario) -> None:
    """All reach 60 Hz with equal P in pu of their own ratings, on whichever phase; processes change no byte."""
    ran = islanded.run("IV")
    last = ran.history.iloc[-1]
    p = np.array([last[row.name, "P"] / row.P_rated for row in INVERTERS])
    f = np.array([last[row.name, "f"] for row in INVERTERS])

    assert np.abs(f - 60.0).max() < 2e-3
    assert np.ptp(p) < 2e-3
    assert p.mean() > 0.35
    assert islanded.run("IV", "processes").sha256 == ran.sha256


def test_limits_of_gridlabd_with_single_phases_are_named_at_once(islanded: gp.Scenario) -> None:
    """GridLAB-D takes one inverter per bus, and keeps no island with single-phase GFM alone."""
    with pytest.raises(ValueError, match="takes one inverter a bus") as refused:
        islanded.replace({"plant.simulator": "gridlabd", "event[0].open": ["grid", "lateral"]})

    assert 'bus "3" has legA, legC' in str(refused.value)
    assert 'event "islanding" leaves an island to leg5, and in GridLAB-D a GFM of three phases' in str(refused.value)


TEXT = """
[time]
end_s = 1.2
[[event]]
label = "islanding"
t_s = 0.2
open = ["13-152"]
[[event]]
label = "step"
t_s = 0.6
load = { 48 = { factor = 3 }, 76 = { P_kW = 0 } }
[case.IV]
secondary = "all"
graph = "full"
"""
SAID = "load 48 set to 630 kW and 450 kvar at nominal voltage, 3 times its table"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Result:
    folder = tmp_path_factory.mktemp("loads")
    (folder / "loads.toml").write_text(TEXT, encoding="utf-8")
    return gp.load(folder / "loads.toml").run("IV", folder=folder / "out")


def test_the_events_of_a_run_have_its_loads(run: Result) -> None:
    """Each change is a row with its time and the new power."""
    loads = run.events[run.events["kind"] == "load"]

    assert list(zip(loads["t"], loads["subject"], strict=True)) == [(0.6, "48"), (0.6, "76")]
    assert loads["text"].iloc[0] == SAID
    P = run.history.xs("P", axis=1, level="quantity").sum(axis=1)
    assert P.loc[1.2] - P.loc[0.59] == pytest.approx(420e3 - 245e3, rel=0.2)


def test_an_explanation_and_a_counterfactual_have_the_change(run: Result, elsewhere: Path) -> None:
    """A decision just after it names it; a run under other gains has it too."""
    code, text = invoke("why", str(run.folder), "inv1", "0.62")
    done = gp.counterfactual(run, replace={"gains.k_p": 0.002})

    assert code == 0, text
    assert SAID in text
    assert SAID in set(done.would_be.events["text"])
    assert done.difference is None
