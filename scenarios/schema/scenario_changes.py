"""What a scenario changes in the tables of its feeder: nominal frequency, loads, droops, ratings."""

from __future__ import annotations

from plant.equipment import Feeder
from plant.plant_config import FeederChanges, InverterChange
from plant.tables.feeder_changes import changed
from scenarios.schema.scenario_errors import Problems
from scenarios.schema.scenario_model import InverterTable, ScenarioModel
from wire.suggestion import suggestion


def changes_of(scenario: ScenarioModel) -> FeederChanges:
    """Changes in SI units and per unit.

    Examples
    --------
    >>> from scenarios.schema import load_scenario
    >>> changes_of(load_scenario("islanding")[0]) == FeederChanges()
    True
    """
    plant = scenario.plant
    return FeederChanges(
        f_nom=plant.f_nom_Hz,
        load_factor=plant.load_factor,
        m_p_factor=plant.m_p_factor,
        m_q_factor=plant.m_q_factor,
        inverters={name: _change(table) for name, table in plant.inverter.items()},
    )


def as_in(scenario: ScenarioModel, feeder: Feeder) -> Feeder:
    """Apply a scenario's changes to its feeder as read from the tables."""
    return changed(feeder, changes_of(scenario))


def check_changes(scenario: ScenarioModel, feeder: Feeder, problems: Problems) -> None:
    """Note inverters that there are not, and tables that change nothing."""
    rows = {row.name: row for row in (*feeder.inverters, *feeder.spares)}
    keys = InverterTable.__struct_fields__
    for name, table in scenario.plant.inverter.items():
        path = f"plant.inverter.{name}"
        if name not in rows:
            problems.add(path, f'no inverter "{name}"; {suggestion(name, rows, "inverters")}')
        elif table == InverterTable() and not problems.below(path):
            problems.add(path, f"changes nothing; give it one of {', '.join(keys)}")


def _change(table: InverterTable) -> InverterChange:
    P_rated = None if table.P_rated_kW is None else 1e3 * table.P_rated_kW
    return InverterChange(m_p=table.m_p_pu, m_q=table.m_q_pu, P_rated=P_rated)
