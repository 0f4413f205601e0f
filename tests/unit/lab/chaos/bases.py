"""Scenarios to be disturbed by tests."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import msgspec

from gridpeers.lab.chaos.chaos_run import ChaosRow, judged
from gridpeers.lab.chaos.disturbed_scenario import ChaosBase
from gridpeers.scenarios.schema import load_scenario

NAMES = ("islanding", "plug-n-play", "microgrid-switching")


@cache
def base_named(name: str) -> ChaosBase:
    return _last_case(name)


def base_in(file: Path) -> ChaosBase:
    return _last_case(file)


def _last_case(name: str | Path) -> ChaosBase:
    scenario, feeder = load_scenario(name)
    case = list(scenario.cases)[-1]
    return ChaosBase(msgspec.structs.replace(scenario, cases={case: scenario.cases[case]}), feeder)


def run_scenario(base: ChaosBase) -> ChaosRow:
    return judged(base, base.scenario, ChaosRow(number=0, schedule=()), "inprocess")[0]
