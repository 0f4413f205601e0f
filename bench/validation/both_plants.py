"""Part "gridlabd": our plant and GridLAB-D through the same run, step by step.

GridLAB-D 6.0.0 (its delta mode, `inverter_dyn`) reads a model that `gridpeers.bridges.gridlabd.glm` writes from
the feeder's tables without the code of `gridpeers.plant.network`. Both plants start from their own equilibrium; in
closed loop each has its own agents.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from bench.validation.gridlabd_runs import ON_ONE_PHASE, RUNS, SHORT, ComparedRun, Reclosing, shortened
from bench.validation.validation_part import CaseResult, ToleranceCheck, ValidationPart, inverter_row
from gridpeers.agents.agent_config import AgentConfig
from gridpeers.bridges.gridlabd.glm import write_tables
from gridpeers.bridges.gridlabd.gridlabd_plant import GridlabdPlant
from gridpeers.plant.equipment import InverterRow, Tables
from gridpeers.plant.feeder import Plant
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantConfig, SwitchEvent
from gridpeers.plant.plant_interface import PlantLike
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.configs import configs

QUANTITIES = {"f": "Hz", "P": "pu", "Q": "pu", "V": "pu", "P_set": "pu", "V_set": "pu"}
"""Quantities of each inverter in a row, and their units of comparison: pu of rating and of nominal voltage."""


class PlantDifferences(NamedTuple):
    """What differs between both plants in one run."""

    t: NDArray[np.float64]
    """Times (s) of the steps."""
    differences: Mapping[str, NDArray[np.float64]]
    """Steps x inverters of each of `QUANTITIES`, in its unit."""
    angles: tuple[float, float] | None
    """Angle (deg) across the reclosed switch in the step before it closes, in ours and in GridLAB-D."""


def compare(run: ComparedRun, factor: float = 1.0) -> PlantDifferences:
    """Take both plants through a run, all of whose times are multiplied by a factor."""
    scenario, feeder = load_scenario(run.scenario)
    V_nom = {bus.name: bus.V_nom for bus in feeder.buses}
    added = (
        inverter_row(name, kind, bus, P_rated, V_nom[bus], phases=phase, microgrid="single-phase")
        for name, kind, bus, phase, P_rated in (ON_ONE_PHASE if run.single_phase else ())
    )
    feeder = replace(feeder, inverters=(*feeder.inverters, *added))
    config, agents = configs(scenario, feeder, run.case)
    settings = replace(
        config.settings,
        gfl=run.gfl or config.settings.gfl,
        gfm=run.gfm or config.settings.gfm,
        events=run.events or config.settings.events,
    )
    run, config = shortened(run, replace(config, settings=settings, record_step=settings.h), factor)
    network = Network(feeder)
    if run.reclosing:
        config = _reclosing_at_its_angle(network, config, run.reclosing)
    assert config.end is not None
    ours = Plant(network, config.settings, config.T_c, config.record_step)
    with closing(_started(ours, feeder, run, config)) as theirs:
        if run.closed_loop:
            first, second = (_closed_loop(plant, config, agents) for plant in (ours, theirs))
        else:
            closes = {event.switch: round(event.t / config.T_c) for event in config.settings.events}
            tick = closes[run.reclosing.switch] if run.reclosing else -1
            first, second = (_open_loop(plant, run, config, tick, network.inverters) for plant in (ours, theirs))
    (t, rows), (t_theirs, rows_theirs) = (_arranged(each.rows, network.inverters) for each in (first, second))
    if not np.array_equal(t, t_theirs):
        raise ValueError(f"rows of {t.size} and {t_theirs.size} steps are not of the same times")
    gaps = np.abs(rows - rows_theirs)
    angles = (first.angle, second.angle) if run.reclosing else None
    return PlantDifferences(t, {quantity: gaps[:, :, k] for k, quantity in enumerate(QUANTITIES)}, angles)


def _started(ours: Plant, feeder: Tables, run: ComparedRun, config: PlantConfig) -> GridlabdPlant:
    """Start GridLAB-D, from the shipped tables, or from tables with further inverters."""
    assert config.end is not None
    with tempfile.TemporaryDirectory() as folder:
        settings = config.settings
        if run.single_phase:
            write_tables(feeder, Path(folder))
            settings = replace(settings, feeder=folder)
        return GridlabdPlant(ours, settings, config.T_c, config.end)


class _PlantRun(NamedTuple):
    """A plant at the end of a run."""

    rows: list[tuple[float, ...]]
    """Of every step, as `Plant.take_rows` has them."""
    angle: float = float("nan")
    """Angle (deg) across the switch that is to close."""


def _reclosing_at_its_angle(network: Network, config: PlantConfig, reclosing: Reclosing) -> PlantConfig:
    """Choose the times so that the switch closes at its angle, on a tick, where both plants can be read.

    Our plant rehearses it. In a control period the angle grows by about a degree; so the switch closes on the first
    tick beyond the angle, and opens as many steps later as take the excess away.
    """

    def schedule(opens: float, closes: float) -> PlantConfig:
        end = round((closes + reclosing.further) / config.T_c) * config.T_c
        events = (
            SwitchEvent(t=opens, switch=reclosing.switch, action="open"),
            SwitchEvent(t=closes, switch=reclosing.switch, action="close"),
        )
        return replace(config, settings=replace(config.settings, events=events), end=end)

    h, T_c = config.settings.h, config.T_c
    rehearsal = Plant(network, schedule(reclosing.opens, 60.0).settings, T_c, T_c)
    before, angle = 0.0, 0.0
    while angle < reclosing.angle:
        rehearsal.advance()
        difference = rehearsal.difference_across(reclosing.switch)
        before, angle = angle, difference.angle if difference else 0.0
    later = round((angle - reclosing.angle) / (angle - before) * T_c / h)
    return schedule(reclosing.opens + later * h, rehearsal.tick * T_c)


def _closed_loop(plant: PlantLike, config: PlantConfig, agents: tuple[AgentConfig, ...]) -> _PlantRun:
    rows: list[tuple[float, ...]] = []
    outcome = run_inprocess(config, agents, lambda telemetry: rows.extend(telemetry.rows), plant=plant)
    if outcome.broke:
        raise RuntimeError(outcome.broke)
    return _PlantRun(rows)


def _open_loop(
    plant: Plant | GridlabdPlant, run: ComparedRun, config: PlantConfig, closing: int, inverters: Sequence[InverterRow]
) -> _PlantRun:
    """Go through a run, and read the angle across the switch at the tick at which it closes."""
    assert config.end is not None
    units = {unit.name: unit for unit in inverters}
    given = {round(each.t / config.T_c): each for each in run.set_points}
    angle = float("nan")
    for tick in range(round(config.end / config.T_c)):
        if tick in given:
            P_set, V_set = given[tick].P_set, given[tick].V_set
            for name in given[tick].inverters:
                plant.hold(name, P_set * units[name].P_rated, V_set * units[name].V_nom)
        if run.reclosing and tick == closing:
            angle = _angle_across(plant, run.reclosing.switch)
        plant.advance()
    return _PlantRun(list(plant.take_rows()), angle)


def _angle_across(plant: Plant | GridlabdPlant, switch: str) -> float:
    """Return the largest angle (deg) between equal phases of the two sides of an open switch."""
    if isinstance(plant, Plant):
        difference = plant.difference_across(switch)
        assert difference is not None
        return difference.angle
    one, other = (plant.phasors(bus) for bus in switch.split("-"))
    return float(np.degrees(np.abs(np.angle(np.array(one) / np.array(other)))).max())


def _arranged(
    rows: Sequence[tuple[float, ...]], units: Sequence[InverterRow]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the times (s), and steps x inverters x quantities in the units of `QUANTITIES`."""
    table = np.array(rows)
    P, V = (np.array([getattr(unit, name) for unit in units]) for name in ("P_rated", "V_nom"))
    bases = np.column_stack([np.ones(len(units)), P, P, V, P, V])
    return table[:, 0], table[:, 1:].reshape(len(table), len(units), len(QUANTITIES)) / bases


ANGLE_LIMIT = 0.1
"""How far (deg) from its angle a switch may close: a step shifts it by as much."""


def _run(case: str, factor: float = 1.0) -> CaseResult:
    run = RUNS[case]
    compared = compare(run, factor)
    checks = [
        ToleranceCheck(f"{quantity}, {unit}", float(compared.differences[quantity].max()), run.tolerance)
        for quantity, unit in QUANTITIES.items()
    ]
    facts = {"closed at": ""}
    if run.reclosing and compared.angles:
        off = max(abs(angle - run.reclosing.angle) for angle in compared.angles)
        checks.append(ToleranceCheck("angle, deg", off, ANGLE_LIMIT))
        facts["closed at"] = f"-{compared.angles[0]:.2f} deg, GridLAB-D -{compared.angles[1]:.2f} deg"
    return CaseResult(case, tuple(checks), facts)


GRIDLABD = ValidationPart(
    "gridlabd",
    ("gridlabd",),
    {name: run.text for name, run in RUNS.items()},
    _run,
    run_short=lambda case: _run(case, SHORT),
)
