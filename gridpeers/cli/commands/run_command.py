"""The command `gridpeers run`."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, cast

import typer

from gridpeers.cli.commands.options import Keys
from gridpeers.cli.progress import COMPILING, progress
from gridpeers.cli.usage import (
    BROKEN,
    CLAIM_FAILED,
    PASSED,
    FigureFormat,
    ScenarioName,
    chosen,
    ended_by_signals,
    fail,
    flag,
    load,
    option,
    require_loadable,
    terminal,
)
from gridpeers.wire.driver.command_line import command_line

if TYPE_CHECKING:
    from gridpeers.plant.equipment import Tables
    from gridpeers.runs.choices import Pace
    from gridpeers.scenarios.run_request import Clock
    from gridpeers.scenarios.schema import ScenarioModel


def run(
    scenario: ScenarioName,
    driver: Annotated[
        Literal["processes", "inprocess"],
        typer.Option(help="processes: a plant process and one process per agent, over Zenoh; inprocess: all in one."),
    ] = "processes",
    clock: Annotated[
        str,
        option(
            "simulated|realtime",
            "simulated: in lock-step, with the same result every time; realtime: each agent by its own clock.",
        ),
    ] = "simulated",
    speed: Annotated[float, option("X", "With --clock realtime: seconds of run time per second of real time.")] = 1.0,
    strict: Annotated[bool, flag("With --clock realtime: end the run if it cannot keep pace.", "--strict")] = False,
    plant: Annotated[
        str | None,
        option("NAME", "Simulator of the plant: gridpeers, gridlabd or helics; the scenario's if left out."),
    ] = None,
    processes: Annotated[int, option("N", "Number of processes that the agents share; 0: one per agent.")] = 0,
    keys: Keys = None,
    case: Annotated[str | None, option("NAMES", "Cases to run, e.g. I,IV; all if left out.")] = None,
    seed: Annotated[int | None, option("N", "Seed in place of the scenario's.", min=0)] = None,
    require_checks: Annotated[bool, flag("End with code 1 if a check fails unexpectedly.", "--require-checks")] = False,
    details: Annotated[bool, flag("Print the whole report.txt: tables, claims, checks, notes.", "--details")] = False,
    figures: FigureFormat = "png",
    out: Annotated[
        Path | None, option("DIR", "Folder for the results, new or empty; runs/SCENARIO/TIME if left out.")
    ] = None,
) -> None:
    """Run a scenario and print its results.

    Example:  gridpeers run islanding --case IV --driver inprocess
    """
    spec, feeder = load(scenario, {} if plant is None else {"plant.simulator": plant})
    spec = chosen(spec, case, seed)

    from gridpeers.plant.simulators import SIMULATORS
    from gridpeers.runs.choices import check_how
    from gridpeers.scenarios.drivers.free_endpoint import free_endpoint, local_endpoint
    from gridpeers.scenarios.results.run_files import new_folder, shown
    from gridpeers.scenarios.run import run as run_scenario
    from gridpeers.scenarios.run_request import BrokenRunError, LawStopError, Request

    pace: Pace = {"clock": cast("Clock", clock), "speed": speed, "strict": strict, "processes": processes, "keys": keys}
    check_how(driver, pace, spec, dash="--")
    if keys is not None:
        _check_keys(keys, spec, feeder)
    simulator = SIMULATORS.resolve(spec.plant.simulator)
    if simulator.package:
        require_loadable(simulator.package, simulator.words)
    if driver == "processes":
        free_endpoint(local_endpoint(spec.processes.port), option="processes.port")
    folder = new_folder(out, spec.name, datetime.now().astimezone())  # noqa: TID251  # folders are named by the day
    request = Request(scenario=spec, feeder=feeder, driver=driver, folder=folder, figures=figures, **pace)
    console, left = terminal(), f"what came until then is in {shown(folder)}/"
    try:
        said = simulator.starting(spec.plant.simulators.get(spec.plant.simulator)) or COMPILING
        with ended_by_signals(left), progress(console, tuple(spec.cases), said) as tell:
            report = run_scenario(request, tell)
    except BrokenRunError as error:
        by_law = isinstance(error, LawStopError)
        why = f"FAILED  {error}" if by_law else f"the run broke: {error}"
        fail(why, *([left] if folder.is_dir() else []), code=CLAIM_FAILED if by_law else BROKEN)
    from gridpeers.scenarios.results.report import show, show_summary  # imports numpy, which the run does without

    if details:
        show(report, console)
    else:
        ours = spec.plant.simulator == "gridpeers"
        after = command_line("up", scenario) if ours else command_line("export", shown(folder))
        show_summary(report, console, after, figures)
    raise typer.Exit(CLAIM_FAILED if report.fails(checks=require_checks) else PASSED)


def _check_keys(folder: Path, spec: ScenarioModel, feeder: Tables) -> None:
    """Check the certificates that a run needs before anything starts; say which end soon."""
    from gridpeers.scenarios.schema.configs import configs, secured
    from gridpeers.scenarios.schema.participants import inverters_of

    inverters = tuple(row.name for row in inverters_of(spec, feeder))
    notes: dict[str, None] = {}
    for case in spec.cases:
        plant, agents = configs(spec, feeder, case)
        started = {agent.name for agent in agents}
        notes |= dict.fromkeys(secured(plant, agents, folder, started=started, inverters=inverters)[2])
    for note in notes:
        typer.echo(f"NOTE  {note}")
