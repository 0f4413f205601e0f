"""One run from a checked scenario to its folder: cases, records, metrics, figures, claims, report.

`run_case` gives the configurations of a case to a driver (`gridpeers.scenarios.drivers`), and its telemetry to its
record; all else here comes of the records.
"""

from __future__ import annotations

import dataclasses
import traceback
from collections.abc import Callable
from datetime import datetime
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.realtime.pacer import sentence
from gridpeers.plant.simulators import SIMULATORS
from gridpeers.scenarios.checks.check_registry import ALWAYS, CHECKS
from gridpeers.scenarios.drivers.free_endpoint import local_endpoint
from gridpeers.scenarios.record.record_info import RecordInfo
from gridpeers.scenarios.results.record import Recorded, Recorder, RecordError
from gridpeers.scenarios.results.recorded_events import ended_by_a_law
from gridpeers.scenarios.results.run_files import broken_if_ended, no_room, refusal, set_complete, shown, write_whole
from gridpeers.scenarios.run_request import BrokenRunError, LawStopError, Outcome, Progress, Request
from gridpeers.scenarios.schema.configs import configs, secured
from gridpeers.scenarios.schema.participants import inverters_of
from gridpeers.scenarios.schema.scenario_writing import to_toml
from gridpeers.scenarios.versions import version_of, versions
from gridpeers.wire.driver.ending import OutputLostError
from gridpeers.wire.driver.machine import too_few_files
from gridpeers.wire.messages import Pacing, Telemetry
from gridpeers.wire.wording import not_importable

if TYPE_CHECKING:
    from gridpeers.plant.plant_interface import PlantLike
    from gridpeers.scenarios.results.report import RunReport

_AFTER_RUN = ("record.record_reader", "measured_run", "results.plots.run_figures")
"""Modules that are used after a run, and imported while it goes on: this process has little to do then."""


def run(request: Request, progress: Progress) -> RunReport:
    """Run all cases and write the whole folder; BrokenRunError if a case broke, as `status.txt` says then."""
    request = dataclasses.replace(request, folder=request.folder.absolute())  # a law or metric may go elsewhere
    with broken_if_ended(request.folder):
        try:
            return _logged(request, progress)
        except OSError as error:  # there was no room for anything, not even for the log
            raise BrokenRunError(refusal(request.folder, error)) from error


def _logged(request: Request, progress: Progress) -> RunReport:
    file = request.folder / "log" / "run.log"
    file.parent.mkdir()
    with file.open("w", encoding="utf-8", errors="backslashreplace") as log:
        try:
            return _run(request, progress, log)
        except (BrokenRunError, OutputLostError) as error:
            print(f"broken: {error}", file=log)
            raise
        except Exception as error:
            if no_room(error) or not file.exists():  # the folder is gone, and with it this log
                raise
            traceback.print_exc(file=log)
            if why := too_few_files(error):
                raise BrokenRunError(why) from error
            if isinstance(error, ImportError):
                raise BrokenRunError(not_importable(error)) from error
            raise BrokenRunError(f"{type(error).__name__}: {error} (traceback in {shown(file)})") from error


def _run(request: Request, progress: Progress, log: TextIO) -> RunReport:
    scenario, folder, place = request.scenario, request.folder, shown(request.folder)
    package = SIMULATORS.resolve(scenario.plant.simulator).package
    as_run = {"driver": request.driver} | versions() | ({package: version_of(package)} if package else {})
    text = to_toml(scenario, as_run)
    write_whole(folder / "scenario.toml", text)
    recorded, notes = {}, []
    pacing: dict[str, Pacing] = {}
    for case in scenario.cases:
        recorded[case], outcome = run_case(request, case, text, progress)
        notes += [f"case {case}: {note}" for note in (*outcome.notes, *recorded[case].links.lines())]
        if outcome.pacing is not None:
            pacing[case] = outcome.pacing
            pace = sentence(outcome.pacing, scenario.time.T_c_s / request.speed)
            notes.append(f"case {case}, real time at speed {request.speed:g}: {pace}")
        print(
            f"case {case}: start {outcome.start_s:.2f} s, run {outcome.run_s:.2f} s, {outcome.ticks} ticks",
            *outcome.notes,
            sep="\n  ",
            file=log,
            flush=True,
        )
    from gridpeers.scenarios.measured_run import write_measures

    if request.clock == "realtime":
        notes.append("in real time every run differs: each has its own delays")
    else:
        notes += [
            f"case {case} cannot be reproduced: something happened that is not in the scenario"
            for case, record in recorded.items()
            if not record.reproducible
        ]
    where = place + "/" if request.lasting else ""
    report, cases = write_measures(request, recorded, pacing, notes, place=where, claims=True)
    if request.lasting:
        from gridpeers.scenarios.results.plots.drawing import drawing_of
        from gridpeers.scenarios.results.plots.run_figures import draw_all

        draw_all(drawing_of(scenario, cases), folder / "plots", request.figures)
    set_complete(folder)
    return report


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
    scenario, real = request.scenario, request.clock == "realtime"
    time = scenario.time
    plant, agents = _configs(request, case)
    record = RecordInfo(
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
        started=datetime.now().astimezone().isoformat(timespec="milliseconds") if real else "",  # noqa: TID251  # the record says when a run began
    )
    ahead = request.lasting and not real  # in real time nothing else may take a core
    with Recorder(request.folder / case, record=record) as recorder:

        def note(telemetry: Telemetry) -> None:
            nonlocal ahead
            if ahead:  # from the first row on: before, every core is busy with the start
                ahead = False
                for module in _AFTER_RUN:
                    import_module(f"gridpeers.scenarios.{module}")
                for check in ALWAYS:
                    CHECKS.resolve(check)
            recorder(telemetry)
            progress(case, recorder.case.ended, time.end_s)

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
            return recorder.finish(time.end_s, time.record_s), outcome
        except RecordError as error:
            raise BrokenRunError(f"case {case}: {error}") from error


def _configs(request: Request, case: str) -> tuple[PlantConfig, tuple[AgentConfig, ...]]:
    listen = local_endpoint(request.scenario.processes.port) if request.driver == "processes" else ""
    real = request.clock == "realtime"
    plant, agents = configs(request.scenario, request.feeder, case, listen, real_nodes=real)
    plant = replace(plant, record=request.scenario.record)
    agents = tuple(replace(agent, record=request.scenario.record) for agent in agents)
    if request.keys is not None:
        inverters = tuple(row.name for row in inverters_of(request.scenario, request.feeder))
        started = {agent.name for agent in agents}
        plant = replace(plant, listen=tuple(text.replace("tcp/", "tls/", 1) for text in plant.listen))
        plant, agents, _ = secured(plant, agents, Path(request.keys), started=started, inverters=inverters)
    if request.clock == "simulated":
        return plant, agents
    if request.driver != "processes":
        raise BrokenRunError("real time needs one process per agent: use the driver processes")
    clock, speed = request.clock, request.speed
    plant = replace(plant, clock=clock, speed=speed, strict=request.strict)
    return plant, tuple(replace(agent, clock=clock, speed=speed) for agent in agents)
