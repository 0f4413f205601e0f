"""One case of a run: its configurations to a driver (`gridpeers.scenarios.drivers`), its telemetry to its record."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from datetime import datetime
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.scenarios.checks.check_registry import ALWAYS, CHECKS
from gridpeers.scenarios.drivers.free_endpoint import local_endpoint
from gridpeers.scenarios.record.record_info import RecordInfo
from gridpeers.scenarios.results.figure_processes import prepare_figures
from gridpeers.scenarios.results.record import Recorded, Recorder, RecordError
from gridpeers.scenarios.results.recorded_events import ended_by_a_law
from gridpeers.scenarios.run_request import BrokenRunError, LawStopError, Outcome, Progress, Request
from gridpeers.scenarios.schema.configs import configs
from gridpeers.scenarios.schema.participants import inverters_of
from gridpeers.scenarios.versions import versions
from gridpeers.wire.messages import Telemetry

if TYPE_CHECKING:
    from gridpeers.plant.plant_interface import PlantLike

_AFTER_RUN = (
    *("results.findings", "results.claims", "results.report"),
    *("results.plots.drawing", "checks.judging"),
)
"""Modules that are used after a run, and imported while it goes on: this process has little to do then."""


def run_case(
    request: Request,
    case: str,
    toml: str,
    progress: Progress,
    plant_at_rest: Callable[[PlantConfig], PlantLike] | None = None,
) -> tuple[Recorded, Outcome]:
    """Run one case by the driver asked for, and record it, with the scenario as run (TOML); or BrokenRunError.

    In one process `plant_at_rest` gives the plant at t = 0 instead of building it.
    """
    time = request.scenario.time
    plant, agents = _configs(request, case)
    record = _record_info(request, case, toml, plant, agents)
    ahead = request.lasting and request.clock == "simulated"  # in real time nothing else may take a core
    with Recorder(request.folder / case, record=record) as recorder:

        def note(telemetry: Telemetry) -> None:
            nonlocal ahead
            if ahead:  # from the first row on: before, every core is busy with the start
                ahead = False
                prepare_figures()
                for module in _AFTER_RUN:
                    import_module(f"gridpeers.scenarios.{module}")
                for check in ALWAYS:
                    CHECKS.resolve(check)
            recorder(telemetry)
            progress(case, recorder.ended, time.end_s)

        progress(case, 0.0, time.end_s)
        try:
            if request.driver == "inprocess":
                from gridpeers.scenarios.drivers.inprocess import run_inprocess

                ready = None if plant_at_rest is None else plant_at_rest(plant)
                outcome = run_inprocess(plant, agents, note, on_other=recorder, plant=ready)
            else:
                from gridpeers.scenarios.drivers.process_driver import run_processes

                logs = request.folder / "log" / case
                outcome = run_processes(plant, agents, logs, note, on_other=recorder, shared=request.processes)
            if outcome.broke:
                stopped = ended_by_a_law(plant.on_law_failure, outcome.events)
                raise (LawStopError if stopped else BrokenRunError)(f"case {case}: {outcome.broke}")
            recorded = recorder.finish(time.end_s, time.record_s)
            if recorder.record_failure:
                outcome = dataclasses.replace(
                    outcome, notes=(*outcome.notes, f"{recorder.record_failure}; the run went on without it")
                )
            return recorded, outcome
        except RecordError as error:
            raise BrokenRunError(f"case {case}: {error}") from error


def _record_info(
    request: Request, case: str, toml: str, plant: PlantConfig, agents: tuple[AgentConfig, ...]
) -> RecordInfo:
    scenario, real = request.scenario, request.clock == "wall"
    return RecordInfo(
        level=plant.record,
        scenario=scenario.name,
        case=case,
        toml=toml,
        seed=scenario.seed,
        driver=request.driver,
        versions=versions(),
        inverters=tuple(row.name for row in inverters_of(scenario, request.feeder)),
        plant=plant,
        agents=agents,
        started=datetime.now().astimezone().isoformat(timespec="milliseconds") if real else "",
    )


def _configs(request: Request, case: str) -> tuple[PlantConfig, tuple[AgentConfig, ...]]:
    listen = local_endpoint(request.scenario.processes.port) if request.driver == "processes" else ""
    real = request.clock == "wall"
    plant, agents = configs(request.scenario, request.feeder, case, listen, real_nodes=real)
    plant = replace(plant, record=request.scenario.record)
    agents = tuple(replace(agent, record=request.scenario.record) for agent in agents)
    if request.bridge:
        own = tuple(name for name in plant.agents if name not in request.outside)
        plant = replace(plant, bridged=request.bridge, agents=own)
        agents = tuple(agent for agent in agents if agent.name not in request.outside)
    if request.keys is not None:
        from gridpeers.scenarios.drivers.secured import secured

        inverters = tuple(row.name for row in inverters_of(request.scenario, request.feeder))
        started = {agent.name for agent in agents}
        plant = replace(plant, listen=tuple(text.replace("tcp/", "tls/", 1) for text in plant.listen))
        plant, agents, _ = secured(plant, agents, Path(request.keys), started=started, inverters=inverters)
    if request.clock == "simulated":
        return plant, agents
    if request.driver != "processes":
        raise BrokenRunError("wall-clock time needs one process per agent: use the driver processes")
    clock, speed = request.clock, request.speed
    plant = replace(plant, clock=clock, speed=speed, strict=request.strict)
    return plant, tuple(replace(agent, clock=clock, speed=speed) for agent in agents)
