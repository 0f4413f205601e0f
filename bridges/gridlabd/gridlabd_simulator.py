"""GridLAB-D as the plant of a run: its start, and what a scenario asks beyond its abilities, before anything starts."""

from __future__ import annotations

import re
from pathlib import Path
from tempfile import TemporaryDirectory

from msgspec.structs import replace

from gridpeers.bridges.gridlabd.glm_network import F_NOM
from gridpeers.plant.equipment import Tables
from gridpeers.plant.equipment.connectivity import Node
from gridpeers.plant.inverters.gfl import Gfl
from gridpeers.plant.plant_config import FeederChanges, PlantConfig
from gridpeers.plant.plant_interface import PlantLike
from gridpeers.plant.simulators import Simulator
from gridpeers.scenarios.schema.scenario_errors import Problems
from gridpeers.scenarios.schema.scenario_model import ScenarioModel
from gridpeers.scenarios.schema.supply import supply_states

_SHOWN = 4
_OTHERWISE = 'or use simulator = "gridpeers"'


class GridlabdSimulator(Simulator):
    package = "gridlabd"
    words = 'the plant of simulator "gridlabd"'

    def start(self, config: PlantConfig, feeder: Tables) -> PlantLike:
        from gridpeers.bridges.gridlabd.glm import write_tables
        from gridpeers.bridges.gridlabd.gridlabd_plant import GridlabdPlant  # scenarios are checked without it
        from gridpeers.plant.feeder import Plant
        from gridpeers.plant.network import Network

        assert config.end is not None, "a scenario in simulated time has an end"
        settings = config.settings
        ours = Plant(Network(feeder), settings, config.T_c, config.record_step)
        with TemporaryDirectory(prefix="gridpeers-tables-") as folder:
            if settings.changes != FeederChanges():  # else GridLAB-D's model is written from the tables as they stand
                write_tables(feeder, Path(folder))
                settings = replace(settings, feeder=folder)
            return GridlabdPlant(
                ours,
                settings,
                config.T_c,
                config.end,
                record_step=config.record_step,
                deadline=0.8 * config.deadline,  # the plant tells the agents before they give it up
            )

    def check(self, scenario: ScenarioModel, feeder: Tables, problems: Problems) -> None:
        for text in unrepresentable(feeder):
            path = "plant.feeder" if scenario.plant.f_nom_Hz is None else "plant.f_nom_Hz"
            problems.add(path, f"{text}; change it, {_OTHERWISE}")
        steps = 1.0 / scenario.time.h_s if scenario.time.h_s else 0.0
        if abs(steps - round(steps)) > 1e-6 and not problems.touch("time.h_s"):
            text = f"GridLAB-D's step must divide 1 s, got {scenario.time.h_s:g} s; choose 0.002 s, {_OTHERWISE}"
            problems.add("time.h_s", text)
        for i, event in enumerate(scenario.events):
            if event.synchronised:
                problems.add(
                    f"event[{i}].synchronised",
                    f'event "{event.label}": GridLAB-D as the plant has no synchronism check; '
                    f"close at a time that you know to be good, without it, {_OTHERWISE}",
                )
        beyond: dict[str, str] = {}
        for row in feeder.inverters:
            own = feeder.parameters_of(row, scenario.plant.gfm, scenario.plant.gfl)
            kind = row.kind.lower()
            for key, value in own.beyond_gridlabd().items():
                text = f"GridLAB-D has no such {row.kind}, got {value} at {row.name}; leave it out"
                beyond.setdefault(f"plant.{kind}.{key}", text)
            if isinstance(own, Gfl) and own.P_set_lim > own.S_max:
                beyond.setdefault(
                    "plant.gfl.P_set_lim_pu",
                    f"GridLAB-D clips P_set at S_max_pu = {own.S_max:g} pu, got {own.P_set_lim:g} pu at {row.name}; "
                    "choose at most that",
                )
        for path, text in beyond.items():
            problems.add(path, f"{text}, {_OTHERWISE}")
        _check_supply(scenario, feeder, problems)

    def starting(self, table: None) -> str:
        return (
            "still starting: GridLAB-D solves the feeder and comes to rest before t = 0; the first run ever compiles "
            "our operating point before that, which takes some 10 seconds ..."
        )


GRIDLABD = GridlabdSimulator()


def _check_supply(scenario: ScenarioModel, feeder: Tables, problems: Problems) -> None:
    """Note events that leave an inverter without voltage, or give it back to a part that had none.

    An inverter of GridLAB-D does not return from there, and its power flow finds no solution from 0 V. Nor does an
    island stay alive there whose GFM are all single-phase.
    """
    index = {event.label: i for i, event in enumerate(scenario.events)}
    dead_before: frozenset[Node] | None = None
    for state in supply_states(scenario, feeder):
        path, event, when = "plant.feeder", "", "at t = 0 the switches leave"
        if state.event is not None:
            path, event = f"event[{index[state.event.label]}]", f'event "{state.event.label}"'
            when = f"{event} leaves"
        for part in state.islands:
            forming = [row for row in feeder.inverters if row.kind == "GFM" and row.node in part]
            if all(len(row.phases) == 1 for row in forming):
                names = ", ".join(row.name for row in forming)
                text = f"{when} an island to {names}, and in GridLAB-D a GFM of three phases must form one"
                problems.add(path, f"{text}; leave one connected to it, {_OTHERWISE}")
        if dead_before is not None:
            if idle := [row.name for row in feeder.inverters if row.node in state.new]:
                problems.add(
                    path,
                    f"{event} de-energises {', '.join(idle)}, and an inverter of GridLAB-D needs a voltage; "
                    f"leave a GFM connected to it, {_OTHERWISE}",
                )
            if again := sorted({bus for bus, _ in dead_before - state.dead}):
                some = ", ".join(again[:_SHOWN]) + (", ..." if len(again) > _SHOWN else "")
                problems.add(
                    path,
                    f"{event} energises {len(again)} de-energised buses again ({some}), for which GridLAB-D finds no "
                    f"solution; leave their switch open, {_OTHERWISE}",
                )
        dead_before = state.dead


GLM_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")
"""Names that GridLAB-D takes for an object: a dot would begin the name of a property."""


def unrepresentable(feeder: Tables) -> list[str]:
    """Return a sentence for everything that the model cannot represent."""
    if feeder.elements or feeder.load_parts:
        return [
            f"{feeder.name} was imported: its elements are admittance matrices, which no object of GridLAB-D takes; "
            "a feeder of our own tables can be written"
        ]
    problems = []
    if feeder.source is None:
        problems.append(f"{feeder.name} has no source.csv; GridLAB-D needs a substation as its swing bus")
    if feeder.f_nom != F_NOM:
        problems.append(f"{feeder.name} has {feeder.f_nom:g} Hz; the model is written for {F_NOM:g} Hz")
    at: dict[str, list[str]] = {}
    for row in feeder.inverters:
        at.setdefault(row.bus, []).append(row.name)
    for bus, there in at.items():
        if len(there) > 1:
            problems.append(
                f'bus "{bus}" has {", ".join(there)}; GridLAB-D takes one inverter a bus: give each a bus behind a line'
            )
    for kind, rows, prefix in (
        *(("bus", feeder.buses, "n"), ("line", feeder.lines, "l"), ("kind of line", feeder.line_configs, "c")),
        *(("switch", feeder.switches, "s"), ("transformer", feeder.transformers, "t")),
        *(("regulator", feeder.regulators, ""), ("inverter", feeder.inverters, "")),
    ):
        for name in dict.fromkeys(row.name for row in rows):
            if not GLM_NAME.fullmatch(prefix + name):
                problems.append(f'{kind} "{name}": GridLAB-D takes letters, digits, _ and - for a name; rename it')
    return problems
