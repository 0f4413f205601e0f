"""Short runs of the experiments' scenarios in this process, with other links than the files have."""

from __future__ import annotations

from functools import cache
from typing import Any

import msgspec
import pandas as pd

from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem
from gridpeers.papers.singhal2022.experiments.experiment_data import CaseData, SweepData
from gridpeers.plant.equipment import Tables
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.results.history import History
from gridpeers.scenarios.results.record import Recorder
from gridpeers.scenarios.schema import ScenarioModel, load_scenario
from gridpeers.scenarios.schema.configs import configs
from gridpeers.scenarios.sweep.sweep_case import plant_at_start, run_one

ALL = "* <-> *"


def measured(scenario: str, case: str, end_s: float, *links: Fault, **of: Any) -> dict[str, float | None]:
    """Indexes of event 1 in one case, by their names; keys of the case can be changed."""
    spec, _ = load_scenario(scenario)
    rule = spec.cases[case]
    changed = {name: msgspec.structs.replace(getattr(rule, name), **values) for name, values in of.items()}
    spec = msgspec.structs.replace(
        spec,
        time=msgspec.structs.replace(spec.time, end_s=end_s),
        events=spec.events[:1],
        netem=Netem(links=links),
        cases={case: msgspec.structs.replace(rule, **changed)},
    )
    done = run_one(0, spec, case)
    assert done.status == "ran", done.why
    return {name.removeprefix("event1."): value for name, value in done.measures.items()}


def told(scenario: str, end_s: float, *cases: str) -> CaseData:
    spec, feeder = load_scenario(scenario)
    spec = msgspec.structs.replace(spec, time=msgspec.structs.replace(spec.time, end_s=end_s))
    return CaseData(scenario=spec, feeder=feeder, histories={case: _history(spec, feeder, case) for case in cases})


@cache
def theory(scenario: str) -> SweepData:
    """A scenario's inputs of the theory, without any runs."""
    return SweepData(rows=pd.DataFrame(), base=load_scenario(scenario)[0], window="event1")


def _history(spec: ScenarioModel, feeder: Tables, case: str) -> History:
    plant, agents = configs(spec, feeder, case)
    recorder = Recorder()
    outcome = run_inprocess(plant, agents, recorder, plant=plant_at_start(plant))
    assert not outcome.broke, outcome.broke
    return recorder.finish(spec.time.end_s, spec.time.record_s).history
