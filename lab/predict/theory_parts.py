"""The theory of a scenario, part by part; `gridpeers.predict` has all of it for one case (docs/understand/findings.md).

The functions take what a scenario holds: its keys as typed values (`Scenario.spec`) and its feeder (`Scenario.feeder`).
"""

from __future__ import annotations

from msgspec.structs import replace

from gridpeers.lab.predict.droop_runs import VarResponse, load_steps, var_delay_limit, var_growth, var_response
from gridpeers.lab.predict.inverter_group import InverterGroup, inverter_group_of
from gridpeers.lab.predict.linear_model import Loop, Ticks, delay_limit
from gridpeers.lab.predict.times import LoadStep, Times, predicted_times, sharing_index
from gridpeers.netem.schema.netem import Netem
from gridpeers.plant.equipment import Tables
from gridpeers.plant.tables import read_feeder
from gridpeers.scenarios.schema import Case, ScenarioModel
from gridpeers.scenarios.schema.configs import as_in

__all__ = [
    "Case",
    "InverterGroup",
    "LoadStep",
    "Loop",
    "ScenarioModel",
    "Tables",
    "Ticks",
    "Times",
    "VarResponse",
    "delay_limit",
    "feeder_of",
    "first_window",
    "inverter_group_of",
    "load_steps",
    "predicted_times",
    "sharing_index",
    "var_delay_limit",
    "var_growth",
    "var_response",
    "without_faults",
]


def feeder_of(spec: ScenarioModel) -> Tables:
    return as_in(spec, read_feeder(spec.plant.feeder, spec.plant.load_set))


def without_faults(spec: ScenarioModel) -> ScenarioModel:
    return replace(spec, netem=Netem())


def first_window(spec: ScenarioModel, length_s: float) -> ScenarioModel:
    (first, *_) = spec.events
    time = replace(spec.time, end_s=first.t_s + length_s)
    return replace(without_faults(spec), events=(first,), time=time)
