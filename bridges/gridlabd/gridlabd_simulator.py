"""GridLAB-D as the plant of a run: its start, and what a scenario asks beyond its abilities, before anything starts."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from itertools import pairwise

from msgspec.structs import replace

from gridpeers.bridges.gridlabd.model.unrepresentable import beyond_gridlabd, unrepresentable
from gridpeers.plant.equipment import Feeder
from gridpeers.plant.equipment.inverter_parameters import GflParameters, GfmParameters, InverterParameters
from gridpeers.plant.plant_config import FeederChanges, PlantConfig
from gridpeers.plant.plant_interface import LivePlant
from gridpeers.plant.simulators import Simulator
from gridpeers.scenarios.schema.scenario_errors import Problems
from gridpeers.scenarios.schema.scenario_model import ScenarioModel
from gridpeers.scenarios.schema.supply import supply_states

_SHOWN = 4

_OTHERWISE = 'or use simulator = "gridpeers"'


class GridlabdSimulator(Simulator):
    """GridLAB-D in its delta mode."""

    package = "gridlabd"
    words = 'the plant of simulator "gridlabd"'

    def start(self, config: PlantConfig, feeder: Feeder) -> LivePlant:
        """Start GridLAB-D on a feeder, with the powers of our operating point.

        Raises
        ------
        RuntimeError
            If there is no operating point, the wheel is missing, or GridLAB-D refuses the model.
        """
        from gridpeers.bridges.gridlabd.gridlabd_plant import GridlabdPlant  # scenarios are checked without it
        from gridpeers.bridges.gridlabd.model.export_glm import write_tables
        from gridpeers.plant.feeder import Plant
        from gridpeers.plant.network import Network
        from gridpeers.plant.request_process import TransientFolder

        assert config.end is not None, "a scenario in simulated time has an end"
        settings = config.settings
        ours = Plant(Network(feeder), settings, config.T_c, config.record_step)
        with closing(TransientFolder("gridpeers-tables-")) as folder:
            if settings.changes != FeederChanges():  # else GridLAB-D's model is written from the tables as they stand
                write_tables(feeder, folder.path)
                settings = replace(settings, feeder=str(folder.path))
            return GridlabdPlant(
                ours,
                settings,
                config.T_c,
                config.end,
                record_step=config.record_step,
                deadline=0.8 * config.deadline,  # the plant tells the agents before they give it up
            )

    def check(self, scenario: ScenarioModel, feeder: Feeder, problems: Problems) -> None:
        """Note what a scenario asks for beyond GridLAB-D's delta mode and our model of it."""
        _check_network(scenario, feeder, problems)
        _check_parameters(scenario, feeder, problems)
        _check_supply(scenario, feeder, problems)

    def starting(self, table: None) -> str:
        """Return what to tell a person who waits for the start."""
        return (
            "still starting: GridLAB-D solves the feeder and comes to rest before t = 0; the first run ever compiles "
            "our operating point before that, which takes some 10 seconds ..."
        )


GRIDLABD = GridlabdSimulator()


def _check_network(scenario: ScenarioModel, feeder: Feeder, problems: Problems) -> None:
    """Note what the feeder, the step and the events ask for beyond GridLAB-D."""
    for text in unrepresentable(feeder):
        path = "plant.feeder" if scenario.plant.f_nom_Hz is None else "plant.f_nom_Hz"
        problems.add(path, f"{text}; change it, {_OTHERWISE}")
    steps = 1.0 / scenario.time.h_s if scenario.time.h_s else 0.0
    if abs(steps - round(steps)) > 1e-6 and not problems.touch("time.h_s"):
        problems.add(
            "time.h_s", f"GridLAB-D's step must divide 1 s, got {scenario.time.h_s:g} s; choose 0.002 s, {_OTHERWISE}"
        )
    for i, event in enumerate(scenario.events):
        if event.synchronised:
            problems.add(
                f"event[{i}].synchronised",
                f'event "{event.label}": GridLAB-D as the plant has no synchronism check; '
                f"close at a time that you know to be good, without it, {_OTHERWISE}",
            )


def _check_parameters(scenario: ScenarioModel, feeder: Feeder, problems: Problems) -> None:
    """Note parameters that GridLAB-D's inverters do not have, or tie to others."""
    seen: set[str] = set()
    for row in feeder.inverters:
        own = feeder.parameters_of(row, scenario.plant.gfm, scenario.plant.gfl)
        for path, text in _parameters_beyond(row.name, own):
            if path not in seen:
                problems.add(path, f"{text}, {_OTHERWISE}")
                seen.add(path)


def _parameters_beyond(name: str, own: InverterParameters) -> Iterator[tuple[str, str]]:
    """Yield the key and a sentence for every parameter of one inverter that GridLAB-D does not take."""
    kind = "gfm" if isinstance(own, GfmParameters) else "gfl"
    for key, value in beyond_gridlabd(own).items():
        yield f"plant.{kind}.{key}", f"GridLAB-D has no such {kind.upper()}, got {value} at {name}; leave it out"
    if isinstance(own, GflParameters) and own.P_set_lim > own.S_max:
        yield (
            "plant.gfl.P_set_lim_pu",
            f"GridLAB-D clips P_set at S_max_pu = {own.S_max:g} pu, got {own.P_set_lim:g} pu at {name}; "
            "choose at most that",
        )


def _check_supply(scenario: ScenarioModel, feeder: Feeder, problems: Problems) -> None:
    """Note events that leave an inverter without voltage, or give it back to a part that had none.

    An inverter of GridLAB-D does not return from there, and its power flow finds no solution from 0 V. Nor does an
    island stay alive there whose GFM are all single-phase.
    """
    index = {event.label: i for i, event in enumerate(scenario.events)}
    for state in supply_states(scenario, feeder):
        for part in state.islands:
            forming = [row for row in feeder.inverters if row.kind == "GFM" and row.node in part]
            if all(len(row.phases) == 1 for row in forming):
                when, path = "at t = 0 the switches leave", "plant.feeder"
                if state.event is not None:
                    when, path = f'event "{state.event.label}" leaves', f"event[{index[state.event.label]}]"
                names = ", ".join(row.name for row in forming)
                text = f"{when} an island to {names}, and in GridLAB-D a GFM of three phases must form one"
                problems.add(path, f"{text}; leave one connected to it, {_OTHERWISE}")
    for before, state in pairwise(supply_states(scenario, feeder)):
        assert state.event is not None, "the first state alone has none"
        path, event = f"event[{index[state.event.label]}]", f'event "{state.event.label}"'
        if idle := [row.name for row in feeder.inverters if row.node in state.new]:
            problems.add(
                path,
                f"{event} de-energises {', '.join(idle)}, and an inverter of GridLAB-D needs a voltage; "
                f"leave a GFM connected to it, {_OTHERWISE}",
            )
        if again := sorted({bus for bus, _ in before.dead - state.dead}):
            some = ", ".join(again[:_SHOWN]) + (", ..." if len(again) > _SHOWN else "")
            problems.add(
                path,
                f"{event} energises {len(again)} de-energised buses again ({some}), for which GridLAB-D finds no "
                f"solution; leave their switch open, {_OTHERWISE}",
            )
