"""Commands that start the plant of a live run: alone, or with all its agents.

Modules of the run are imported after the checks of the options, so a wrong option is reported at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from shutil import rmtree
from typing import Annotated

import typer

from gridpeers.cli.commands.options import Insecure, Keys, Run, check_open, finish, of_live_run, opened
from gridpeers.cli.usage import FigureFormat, ScenarioName, chosen, flag, load, option, require_posix
from gridpeers.scenarios.drivers.free_endpoint import free_endpoint
from gridpeers.scenarios.live.run_address import (
    ENDPOINT,
    RUN,
    Access,
    RunAddress,
    check_endpoint,
    check_name,
    with_protocol,
)
from gridpeers.wire.driver.command_line import command_line
from gridpeers.wire.driver.ending import watch_readers


@dataclass(frozen=True)
class Start:
    """The options of a live run, as typed."""

    scenario: ScenarioName
    case: Annotated[str, option("NAME", "Case of the scenario; the last one if left out.")] = ""
    run: Run = RUN
    listen: Annotated[
        str, option("ENDPOINT", "Endpoint of the plant; for other hosts tls/0.0.0.0:7447 with --keys.", "--listen")
    ] = ENDPOINT
    connect: Annotated[
        list[str] | None, option("ENDPOINT", "Endpoint that the plant connects to, e.g. a Zenoh router; repeatable.")
    ] = None
    speed: Annotated[float, option("X", "Seconds of run time per second of real time, 0.1 to 50.")] = 1.0
    wait: Annotated[float, option("SECONDS", "Longest wait of the plant for its agents before the start.")] = 30.0
    duration: Annotated[
        float | None, option("SECONDS", "Run time (s) at which the run ends; no end if left out.", "--for")
    ] = None
    strict: Annotated[bool, flag("End with exit code 3 if the plant cannot keep pace.", "--strict")] = False
    out: Annotated[Path | None, option("DIR", "Record the run in this new folder, and measure it at its end.")] = None
    figures: FigureFormat = "png"
    keys: Keys = None
    insecure: Insecure = False


def _start(start: Start, *, agents: bool) -> None:
    """Run the plant, with its agents or without, until it ends; end with its exit code."""
    require_posix("a live run")
    from gridpeers.scenarios.live.live_options import check_alone, chosen_case, configure, folders, live_record

    # first: reading a scenario takes seconds, and a forgotten run is reported at once
    run = check_name("--run", start.run)
    credentials = opened(access := Access(keys=start.keys, insecure=start.insecure), ("plant",))
    beyond = tuple(check_endpoint("--connect", text) for text in start.connect or ())
    listen = with_protocol(check_endpoint("--listen", start.listen), keys=start.keys is not None, default=ENDPOINT)
    for name, text in (("--listen", listen), *(("--connect", text) for text in beyond)):
        check_open(name, text, access)
    endpoint = free_endpoint(listen, option="--listen")
    check_alone(run, beyond, credentials, access)

    from gridpeers.scenarios.live.live_processes import all_here, conclude, plant_here, say
    from gridpeers.scenarios.record.record_info import LIVE
    from gridpeers.scenarios.results.recorded_events import ended_by_a_law, first_of, law_failures
    from gridpeers.scenarios.run_request import Request
    from gridpeers.scenarios.schema.configs import secured
    from gridpeers.scenarios.schema.plugin_keys import judges_laws

    spec, feeder = load(start.scenario)
    spec = chosen(spec, chosen_case(spec, start.case), None)
    config, everyone = configure(
        spec,
        feeder,
        endpoint,
        beyond,
        run=run,
        case=start.case,
        speed=start.speed,
        wait=start.wait,
        duration=start.duration,
        strict=start.strict,
        recorded=start.out is not None,
        secured=start.keys is not None,
    )
    inverters = tuple(row.name for row in (*feeder.inverters, *feeder.spares))
    if start.keys is not None:
        started = config.agents if agents else ()
        config, everyone, notes = secured(config, everyone, start.keys, started=started, inverters=inverters)
        for note in notes:
            say(f"NOTE  {note}")
    watch_readers(quits=False)
    with folders(start.out, spec) as kept:
        say(f"run {run}: {spec.name}, case {', '.join(spec.cases)}; the plant listens on {endpoint}")
        info = live_record(spec, config, everyone, inverters)
        if agents:
            found_by = RunAddress(run=run, connect=(endpoint,), access=access).words
            watch, down = command_line("watch", *found_by), command_line("down", *found_by)
            say(f"to see it, type {watch} in another terminal; to end it, type {down} there, or Ctrl-C here")
            outcome = all_here(config, everyone, kept.logs, kept.record, info)
        else:
            outcome = plant_here(config, kept.record, info)
        if kept.whole is not None:
            metrics = Request(
                scenario=spec,
                feeder=feeder,
                driver=LIVE,
                folder=kept.whole,
                clock="realtime",
                speed=start.speed,
                figures=start.figures,
            )
            outcome = conclude(outcome, metrics)
        elif outcome.failed_laws:
            typer.secho(f"FAILED  {first_of(law_failures(outcome.failed_laws))}", fg="red", bold=True)
    if kept.whole is None and not (agents and outcome.broke):  # what broke it names a log
        rmtree(kept.logs, ignore_errors=True)
    stopped = ended_by_a_law(spec.on_law_failure, outcome.failed_laws)
    judged = bool(outcome.failed_laws) and judges_laws(spec)
    finish(outcome, law_failed=stopped or (judged and not outcome.broke))


@of_live_run
def plant(live: Start) -> None:
    """Run the plant of a scenario in this terminal, in real time. Start its agents in others.

    Example:  gridpeers plant islanding --keys lab --listen tls/0.0.0.0:7447
    """
    _start(live, agents=False)


@of_live_run
def up(live: Start) -> None:
    """Run the plant and all its agents, in real time.

    It runs until `gridpeers down` or Ctrl-C.

    Example:  gridpeers up islanding --speed 0.5
    """
    _start(live, agents=True)
