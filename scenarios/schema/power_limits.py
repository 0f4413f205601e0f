"""Available power that changes as a scenario says, in all cases or in one: its problems, and what the plant is told."""

from __future__ import annotations

import math
from collections.abc import Mapping

from plant.equipment import Feeder
from plant.plant_config import PowerLimit
from scenarios.schema.participants import inverters_of
from scenarios.schema.scenario_errors import Problems
from scenarios.schema.scenario_model import ScenarioModel
from wire.suggestion import suggestion


def limits_of(scenario: ScenarioModel, case: str) -> tuple[PowerLimit, ...]:
    """What inverters have available in one case, in the order of time; a case's own numbers go before an event's.

    Examples
    --------
    >>> from scenarios.schema import load_scenario
    >>> limits_of(load_scenario("intermittency")[0], "225kW")[0]
    PowerLimit(t=2.5, inverter='inv2', P_max=225000.0)
    """
    own = scenario.cases[case].P_max_kW
    return tuple(
        PowerLimit(t=event.t_s, inverter=name, P_max=1e3 * kW)
        for event in scenario.events
        for name, kW in (event.P_max_kW | own.get(event.label, {})).items()
    )


def check_limits(scenario: ScenarioModel, feeder: Feeder, problems: Problems) -> None:
    """Who is limited is a GFL of the scenario, by a power that it could have."""
    for i, event in enumerate(scenario.events):
        _check(f"event[{i}].P_max_kW", event.P_max_kW, scenario, feeder, problems)
    for name, case in scenario.cases.items():
        for label, limits in case.P_max_kW.items():
            _check(f"case.{name}.P_max_kW.{label}", limits, scenario, feeder, problems)


def _check(path: str, limits: Mapping[str, float], scenario: ScenarioModel, feeder: Feeder, problems: Problems) -> None:
    rows = {row.name: row for row in inverters_of(scenario, feeder)}
    for name, kW in limits.items():
        if name not in rows:
            problems.add(path, f'no inverter "{name}"; {suggestion(name, rows, "inverters")}')
            continue
        row, most = rows[name], rows[name].P_rated * scenario.plant.gfl.P_max / 1e3
        if row.kind == "GFM":
            following = ", ".join(other.name for other in rows.values() if other.kind == "GFL")
            problems.add(
                path,
                f"{name} is grid-forming and gives what the network takes; only a grid-following inverter can be "
                f"limited: {following or 'there is none'}",
            )
        elif not math.isfinite(kW) or kW < 0.0 or kW > most * (1.0 + 1e-9):
            hint = f"; it is in kW: write {kW / 1e3:g}" if kW > most and kW / 1e3 <= most else ""
            problems.add(path, f"{name} can have from 0 to {most:g} kW available, got {kW:g} kW{hint}")
