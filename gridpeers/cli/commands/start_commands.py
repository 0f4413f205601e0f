"""Commands that start processes of a live run: its plant, its agents, or both. Each imports its modules when used."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gridpeers.cli.commands.options import (
    ENDPOINT,
    RUN,
    Connect,
    Insecure,
    Keys,
    Run,
    Wait,
    address,
    check_open,
    opened,
    usage_errors,
    with_options,
)
from gridpeers.cli.usage import BROKEN, CLAIM_FAILED, INTERRUPTED, TERMINATED, ScenarioName, chosen, fail, load, require
from gridpeers.scenarios.live.run_address import Access
from gridpeers.wire.driver.command_line import command_line
from gridpeers.wire.driver.ending import watch_readers

if TYPE_CHECKING:
    from gridpeers.scenarios.live.live_processes import ProcessOutcome

_Case = Annotated[str, typer.Option("--case", metavar="NAME", help="Case of the scenario; its last when left out.")]
_Listen = Annotated[
    str,
    typer.Option(
        "--listen", metavar="ENDPOINT", help="Where the others connect; with --keys tls/0.0.0.0:7447 for other hosts."
    ),
]
_Beyond = Annotated[
    list[str] | None,
    typer.Option("--connect", metavar="ENDPOINT", help="What the plant connects to itself, e.g. a Zenoh router."),
]
_Speed = Annotated[float, typer.Option("--speed", metavar="X", help="Run time per wall time, 0.1 to 50; 1 is real.")]
_WaitForAgents = Annotated[
    float, typer.Option("--wait", metavar="SECONDS", help="How long the plant waits for its agents before it starts.")
]
_For = Annotated[float | None, typer.Option("--for", metavar="SECONDS", help="Run time to end at; no end if left out.")]
_Strict = Annotated[bool, typer.Option("--strict", help="End with exit code 3 when pace cannot be kept.")]
_Out = Annotated[
    Path | None, typer.Option("--out", metavar="DIR", help="Record the run in a new folder, and measure it at its end.")
]
_Record = Annotated[
    Path | None,
    typer.Option("--record", metavar="FILE", help="Write a scenario that replays what gridpeers link did, for run."),
]


def _start(
    scenario: ScenarioName,
    case: _Case = "",
    run: Run = RUN,
    listen: _Listen = ENDPOINT,
    connect: _Beyond = None,
    speed: _Speed = 1.0,
    wait: _WaitForAgents = 30.0,
    duration: _For = None,
    strict: _Strict = False,
    out: _Out = None,
    record: _Record = None,
    keys: Keys = None,
    insecure: Insecure = False,
    *,
    agents: bool,
) -> None:
    """Run the plant, with its agents or without; its arguments are the options of both commands."""
    require({"numba": "the plant", "zenoh": "the processes"} | ({} if out is None else {"matplotlib": "the figures"}))
    with usage_errors():
        from gridpeers.scenarios.live.live_options import check_alone, endpoint_for_run
        from gridpeers.scenarios.live.run_address import RunAddress, check_endpoint, check_name, with_protocol

        # first: reading a scenario takes seconds, and a forgotten run is reported at once
        check_name("--run", run)
        credentials = opened(access := Access(keys=keys, insecure=insecure), ("plant",))
        beyond = tuple(check_endpoint("--connect", text) for text in connect or ())
        listen = with_protocol(check_endpoint("--listen", listen), keys=keys is not None, default=ENDPOINT)
        for option, text in (("--listen", listen), *(("--connect", text) for text in beyond)):
            check_open(option, text, access)
        endpoint = endpoint_for_run(listen, credentials, access)
        check_alone(run, beyond, credentials, access)
    spec, feeder = load(scenario)
    with usage_errors():
        from gridpeers.scenarios.live.live_files import LinkLog, check_new, folders, live_record
        from gridpeers.scenarios.live.live_options import LiveOptions, chosen_case, configure, manual_node_faults
        from gridpeers.scenarios.live.live_processes import all_here, plant_here, say
        from gridpeers.scenarios.live.live_report import conclude
        from gridpeers.scenarios.record.record_info import LIVE
        from gridpeers.scenarios.results.file_sizes import HOUR, file_sizes, require_room
        from gridpeers.scenarios.results.metrics_file import RunMetrics
        from gridpeers.scenarios.results.recorded_events import ended_by_a_law, first_of, law_failures
        from gridpeers.scenarios.schema.plugin_keys import judges_laws

        check_new(record)
        spec = chosen(spec, chosen_case(spec, case), None)
        options = LiveOptions(
            run=run,
            case=case,
            speed=speed,
            wait=wait,
            duration=duration,
            strict=strict,
            recorded=out is not None,
            secured=keys is not None,
        )
        config, everyone = configure(spec, feeder, options, endpoint, beyond)
        if keys is not None:
            from gridpeers.scenarios.drivers.secured import secured

            inverters = tuple(row.name for row in (*feeder.inverters, *feeder.spares))
            started = config.agents if agents else ()
            config, everyone, notes = secured(config, everyone, keys, started=started, inverters=inverters)
            for note in notes:
                say(f"NOTE  {note}")
        watch_readers(quits=False)
        sizes = file_sizes(spec, feeder, HOUR if duration is None else duration, "wall")
        if out is not None and duration is not None:
            require_room(out, sizes, "--out")
        replay = None if out is None else out / "replay.toml"
        link_log = LinkLog(scenario=spec, feeder=feeder, replay=record, replay_if_changed=replay)
        with folders(out, spec) as kept:
            say(f"run {run}: {spec.name}, case {', '.join(spec.cases)}; the plant listens on {endpoint}")
            if kept.whole is not None and sizes.sentence:
                say(f"run {run}: {'an hour' if duration is None else f'{duration:g} s'} {sizes.sentence}")
            info = live_record(spec, config, everyone, tuple(row.name for row in (*feeder.inverters, *feeder.spares)))
            if agents:
                found_by = RunAddress(run=run, connect=(endpoint,), access=access).words
                watch, down = command_line("watch", *found_by), command_line("down", *found_by)
                say(f"{watch}, in another terminal, shows it; Ctrl-C here, or {down} there, ends it")
                outcome = all_here(config, everyone, kept.logs, kept.record, link_log, info)
            else:
                if note := manual_node_faults(spec):
                    say(note)
                outcome = plant_here(config, kept.record, link_log, info)
            if kept.whole is not None:
                metrics = RunMetrics(
                    scenario=spec, feeder=feeder, driver=LIVE, folder=kept.whole, clock="wall", speed=speed
                )
                outcome = conclude(outcome, metrics)
            elif outcome.failed_laws:
                typer.secho(f"FAILED  {first_of(law_failures(outcome.failed_laws))}", fg="red", bold=True)
        stopped = ended_by_a_law(spec.on_law_failure, outcome.failed_laws)
        judged = bool(outcome.failed_laws) and judges_laws(spec)
        _finish(outcome, law_failed=stopped or (judged and not outcome.broke))


def plant(**options: Any) -> None:
    """Run the plant of a scenario in this terminal, in real time. Agents come from others.

    Exit code: 0 it was ended, 1 a law failed, 2 bad usage, 3 it broke, 130 Ctrl-C.

    Example:  gridpeers plant islanding --keys lab --listen tls/0.0.0.0:7447
    """
    _start(**options, agents=False)


def up(**options: Any) -> None:
    """Run the plant and all its agents at once, in real time.

    It runs until `gridpeers down` or Ctrl-C.

    Exit code: 0 it was ended, 1 a law failed, 2 bad usage, 3 it broke, 130 Ctrl-C.

    Example:  gridpeers up islanding --speed 0.5
    """
    _start(**options, agents=True)


for _command in (plant, up):
    _options = inspect.signature(_start, eval_str=True).parameters.values()
    with_options(_command, [one for one in _options if one.name != "agents"])


def agent(
    inverters: Annotated[
        list[str], typer.Argument(metavar="INVERTER", help="Names of their inverters, e.g. inv2; spare ones too.")
    ],
    run: Run = RUN,
    connect: Connect = None,
    listen: Annotated[
        list[str] | None,
        typer.Option("--listen", metavar="ENDPOINT", help="Where other agents connect; any free port if left out."),
    ] = None,
    wait: Wait = 60.0,
    keys: Keys = None,
    insecure: Insecure = False,
    own_code: Annotated[
        bool,
        typer.Option("--own-code", help="Run a law, graph or link fault that only the plant, on another host, names."),
    ] = False,
) -> None:
    """Run the agent of an inverter, or of several, in this terminal. Ctrl-C leaves properly: they are switched off.

    Exit code: 0 it has left, 2 no plant or no such inverter, 3 it could not go on, 130 Ctrl-C.

    Example:  gridpeers agent inv2 --keys lab --connect tls/192.168.1.10:7447
    """
    require({"zenoh": "an agent"})
    with usage_errors():
        from gridpeers.scenarios.drivers.free_endpoint import free_endpoint
        from gridpeers.scenarios.live.live_processes import agent_here
        from gridpeers.scenarios.live.run_address import UsageError, check_endpoint, check_inverters, check_wait

        check_inverters(inverters)
        if keys is not None and len(inverters) > 1:
            raise UsageError(f"--keys: agents of one process have one certificate; start that of {inverters[1]} alone")
        where = address(run, connect, access := Access(keys=keys, insecure=insecure), ("agent",), inverters[0])
        for text in listen or ():
            check_open("--listen", check_endpoint("--listen", text), access)
        check_wait(wait)
        watch_readers(quits=False)
        listening = tuple(free_endpoint(text, option="--listen") for text in listen or ())
        _finish(agent_here(where, tuple(inverters), listening or None, wait, trusts=own_code))


def _finish(outcome: ProcessOutcome, *, law_failed: bool = False) -> None:
    """End with the exit code of an outcome; `law_failed` takes the place of one that broke, or ended well."""
    if outcome.interrupted:
        code = TERMINATED if outcome.interrupted == "SIGTERM" else INTERRUPTED
        fail([f"{outcome.interrupted}: everything that was started here has ended"], code)
    if outcome.broke:
        fail([outcome.broke], CLAIM_FAILED if law_failed else BROKEN)
    if law_failed:
        raise typer.Exit(CLAIM_FAILED)
