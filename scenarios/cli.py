"""The command `gridpeers`. Heavy modules are imported where they are used, so that help comes at once.

Exit codes: 0 all is well, 1 a claim of the paper failed, 2 bad usage, a bad file, or output that cannot be written,
3 the run broke, 130 interrupted by Ctrl-C, 141 nobody reads the output any more, 143 by SIGTERM.
"""

from __future__ import annotations

import os
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from scenarios.experiments.command import experiment
from scenarios.live.commands import register
from scenarios.mistyped import Commands
from scenarios.predict.command import predict
from scenarios.reproduce.command import reproduce
from scenarios.sweep.command import sweep
from scenarios.usage import (
    BAD_INPUT,
    BROKEN,
    CLAIM_FAILED,
    INSTALL,
    INTERRUPTED,
    PASSED,
    chosen,
    fail,
    load,
    require,
)
from wire.driver.output import speaking

app = typer.Typer(
    cls=Commands,
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    help="Peer-to-peer consensus control of microgrid inverters: a plant process and one process per inverter, over "
    "Zenoh.\n\nExample:  gridpeers run islanding",
)


class DriverName(StrEnum):
    """Values of `--driver`."""

    processes = "processes"
    inprocess = "inprocess"


class ClockName(StrEnum):
    """Values of `--clock`."""

    simulated = "simulated"
    wall = "wall"


class Topic(StrEnum):
    """Values of the argument of `doc`."""

    keys = "keys"
    messages = "messages"
    scenario = "scenario"


def main() -> None:
    """Run the command line; no bad input ends in a traceback."""
    # The plant's matrices are small: a second BLAS thread only spins, and takes a quarter of the time from the run.
    # It must be said before numpy is imported; the processes that are started inherit it.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with speaking("gridpeers"):
        try:
            app()
        except KeyboardInterrupt:
            fail(["interrupted; everything that was started has ended"], INTERRUPTED)
        except ModuleNotFoundError as error:
            fail([f"{error.name} is not installed; {INSTALL}"], BAD_INPUT)
        except OSError as error:  # the machine refuses something: no memory for a process, no room on a disk
            fail([str(error)], BROKEN)


@app.command()
def run(
    scenario: Annotated[
        str, typer.Argument(metavar="SCENARIO", help="A name that `gridpeers list` shows, or the path of a file.")
    ],
    driver: Annotated[
        DriverName,
        typer.Option(help="processes: a plant process and one process per agent, over Zenoh; inprocess: all in one."),
    ] = DriverName.processes,
    clock: Annotated[
        ClockName,
        typer.Option(help="simulated: in lock-step, the same result every time; wall: real time, agents run freely."),
    ] = ClockName.simulated,
    speed: Annotated[
        float, typer.Option(metavar="X", help="With --clock wall: seconds of the run per second of real time.")
    ] = 1.0,
    strict: Annotated[
        bool, typer.Option("--strict", help="With --clock wall: break the run when it cannot keep pace.")
    ] = False,
    case: Annotated[
        str | None, typer.Option(help="Cases to run, e.g. I,IV; all when left out.", metavar="NAMES")
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, metavar="N", help="Seed instead of the one in the scenario.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder for the results, new or empty; runs/SCENARIO/TIME when left out."),
    ] = None,
) -> None:
    """Run a scenario and show its results beside the paper's.

    Exit code: 0 no claim failed (a known miss is shown, with its reason, and is no failure), 1 a claim failed,
    2 bad usage or a bad file, 3 the run broke.

    Example:  gridpeers run islanding --case IV --driver inprocess
    """
    from datetime import datetime

    spec, feeder = load(scenario)
    spec = chosen(spec, case, seed)
    _check_clock(clock, driver, speed, strict)
    needed = {"numba": "the plant", "scipy": "the plant", "threadpoolctl": "the plant", "matplotlib": "the figures"}
    require(needed | ({"zenoh": "the driver with processes"} if driver is DriverName.processes else {}))

    from rich.console import Console

    from scenarios.drivers.ports import PortError, check_port
    from scenarios.interruption import exit_code, interruptible
    from scenarios.progress import progress
    from scenarios.results.folder import FolderError, new_folder, shown
    from scenarios.results.report import show
    from scenarios.run import BrokenRunError, Request
    from scenarios.run import run as run_scenario

    try:
        if driver is DriverName.processes:
            check_port(spec.processes.port)
        folder = new_folder(out, spec.name, datetime.now().astimezone())
    except (FolderError, PortError) as error:
        fail([str(error)], BAD_INPUT)

    console = Console()
    request = Request(
        scenario=spec,
        feeder=feeder,
        driver=driver.value,
        folder=folder,
        clock=clock.value,
        speed=speed,
        strict=strict,
    )
    try:
        with interruptible(), progress(console, tuple(spec.cases)) as tell:
            report = run_scenario(request, tell)
    except BrokenRunError as error:
        kept = [f"what came until then is in {shown(folder)}/"] if folder.is_dir() else []
        fail([f"the run broke: {error}", *kept], BROKEN)
    except KeyboardInterrupt as error:
        fail([f"interrupted; what came until then is in {shown(folder)}/"], exit_code(error))
    show(report, console)
    raise typer.Exit(CLAIM_FAILED if any(verdict.status == "FAIL" for verdict in report.verdicts) else PASSED)


def _check_clock(clock: ClockName, driver: DriverName, speed: float, strict: bool) -> None:
    if clock is ClockName.simulated:
        if speed != 1.0 or strict:
            option = "--strict" if strict else "--speed"
            fail([f"{option}: simulated time has no pace to keep; use it with --clock wall"], BAD_INPUT)
    elif driver is DriverName.inprocess:
        fail(["--clock wall: needs a process per agent; leave out --driver inprocess"], BAD_INPUT)
    elif not 0.1 <= speed <= 50.0:
        fail([f"--speed: must be from 0.1 to 50 (1 is real time), got {speed:g}"], BAD_INPUT)


@app.command("list")
def list_() -> None:
    """List the scenarios that come with gridpeers.

    Example:  gridpeers list
    """
    from scenarios.spec import catalogue

    names = catalogue()
    width = max(map(len, names), default=0)
    for name in names:
        spec, _ = load(name)
        typer.echo(f"{name:{width}}  {spec.title}. Cases: {', '.join(spec.cases)}")


@app.command()
def check(
    file: Annotated[str, typer.Argument(metavar="FILE", help="Path of a scenario file, or a name from the catalogue.")],
) -> None:
    """Check a scenario file and its feeder for mistakes.

    All mistakes are told at once. A file without any is tried: whether its feeder has an operating point to start from.
    Notes tell what its events de-energise.

    Exit code: 0 it can be run, 2 it has mistakes.

    Example:  gridpeers check my-islanding.toml
    """
    spec, feeder = load(file)
    require({"numba": "the plant", "scipy": "the plant", "threadpoolctl": "the plant"})

    from scenarios.operating_point import start_problem
    from scenarios.spec.supply import supply_notes

    if problem := start_problem(spec, feeder):
        fail([f"{file}: the plant cannot start: {problem}"], BAD_INPUT)
    for note in supply_notes(spec, feeder):
        typer.echo(f"NOTE  {note}")
    typer.echo(
        f"{file}: can be run: {len(spec.cases)} case(s) {', '.join(spec.cases)}; {len(spec.events)} event(s); "
        f"{spec.time.end_s:g} s; {len(feeder.inverters)} inverters on {len(feeder.buses)} buses"
    )


@app.command()
def doc(topic: Annotated[Topic, typer.Argument(metavar="keys|messages|scenario", help="What to print.")]) -> None:
    """Print a reference page that is made from the code.

    keys and messages are those of the wire; scenario is the scenario file, with units and defaults.

    Example:  gridpeers doc scenario
    """
    from scenarios.results.reference import page

    typer.echo(page(topic.value), nl=False)


app.command()(reproduce)
app.command()(sweep)
app.command()(predict)
app.command()(experiment)
register(app)
