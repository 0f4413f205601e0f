"""The command `gridpeers`. Heavy modules are imported where they are used, so that help comes at once.

Exit codes: 0 all is well, 1 a claim of the paper failed, 2 bad usage or a bad file, 3 the run broke, 130 interrupted by
Ctrl-C, 143 by SIGTERM.
"""

from __future__ import annotations

import sys
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

if TYPE_CHECKING:
    from plant.equipment import Feeder
    from scenarios.spec import Scenario

PASSED, CLAIM_FAILED, BAD_INPUT, BROKEN, INTERRUPTED, TERMINATED = 0, 1, 2, 3, 130, 143

app = typer.Typer(
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


class Topic(StrEnum):
    """Values of the argument of `doc`."""

    keys = "keys"
    messages = "messages"
    scenario = "scenario"


def main() -> None:
    """Run the command line; no bad input ends in a traceback."""
    try:
        app()
    except KeyboardInterrupt:
        _fail(["interrupted; everything that was started has ended"], INTERRUPTED)


@app.command()
def run(
    scenario: Annotated[
        str, typer.Argument(metavar="SCENARIO", help="A name that `gridpeers list` shows, or the path of a file.")
    ],
    driver: Annotated[
        DriverName,
        typer.Option(help="processes: a plant process and one process per agent, over Zenoh; inprocess: all in one."),
    ] = DriverName.processes,
    case: Annotated[str, typer.Option(help="Cases to run, e.g. I,IV; all when left out.", metavar="NAMES")] = "",
    seed: Annotated[int | None, typer.Option(metavar="N", help="Seed instead of the one in the scenario.")] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder for the results, new or empty; runs/SCENARIO/TIME when left out."),
    ] = None,
) -> None:
    """Run a scenario and show its results beside the paper's.

    Exit code: 0 all claims hold, 1 a claim failed, 2 bad usage or a bad file, 3 the run broke.

    Example:  gridpeers run islanding --case IV --driver inprocess
    """
    import signal
    from datetime import datetime

    spec, feeder = _load(scenario)
    spec = _chosen(spec, case, seed)
    _require({"numba": "the plant"} | ({"zenoh": "the processes"} if driver is DriverName.processes else {}))

    from rich.console import Console

    from scenarios.folder import FolderError, new_folder, shown
    from scenarios.ports import PortError, check_port
    from scenarios.progress import progress
    from scenarios.report import show
    from scenarios.run import BrokenRunError, Request, TerminatedError
    from scenarios.run import run as run_scenario

    try:
        if driver is DriverName.processes:
            check_port(spec.processes.port)
        folder = new_folder(out, spec.name, datetime.now().astimezone())
    except (FolderError, PortError) as error:
        _fail([str(error)], BAD_INPUT)

    def terminate(*_: object) -> NoReturn:
        raise TerminatedError

    before = signal.signal(signal.SIGTERM, terminate)
    console = Console()
    request = Request(scenario=spec, feeder=feeder, driver=driver.value, folder=folder)
    try:
        with progress(console, tuple(spec.cases)) as tell:
            report = run_scenario(request, tell)
    except BrokenRunError as error:
        _fail([f"the run broke: {error}", f"what came until then is in {shown(folder)}/"], BROKEN)
    except KeyboardInterrupt as error:
        code = TERMINATED if isinstance(error, TerminatedError) else INTERRUPTED
        _fail([f"interrupted; what came until then is in {shown(folder)}/"], code)
    finally:
        signal.signal(signal.SIGTERM, before)
    show(report, console)
    raise typer.Exit(CLAIM_FAILED if any(verdict.status == "FAIL" for verdict in report.verdicts) else PASSED)


@app.command("list")
def list_() -> None:
    """List the scenarios that come with gridpeers.

    Example:  gridpeers list
    """
    from scenarios.spec import catalogue

    for name in catalogue():
        spec, _ = _load(name)
        typer.echo(f"{name:16} {spec.title}. Cases: {', '.join(spec.cases)}")


@app.command()
def check(
    file: Annotated[str, typer.Argument(metavar="FILE", help="Path of a scenario file, or a name from the catalogue.")],
) -> None:
    """Check a scenario file and its feeder, and tell every mistake at once.

    Exit code: 0 it can be run, 2 it has mistakes.

    Example:  gridpeers check my-islanding.toml
    """
    spec, feeder = _load(file)
    typer.echo(
        f"{file}: can be run: {len(spec.cases)} case(s) {', '.join(spec.cases)}; {len(spec.events)} event(s); "
        f"{spec.time.end_s:g} s; {len(feeder.inverters)} inverters on {len(feeder.buses)} buses"
    )


@app.command()
def doc(topic: Annotated[Topic, typer.Argument(metavar="keys|messages|scenario", help="What to print.")]) -> None:
    """Print a reference page, made from the code: keys, messages, or the scenario file with units and defaults.

    Example:  gridpeers doc scenario
    """
    from scenarios.reference import page

    typer.echo(page(topic.value), nl=False)


def _load(name: str) -> tuple[Scenario, Feeder]:
    from scenarios.spec import ScenarioError, load_scenario

    try:
        return load_scenario(name)
    except ScenarioError as error:
        count = len(error.mistakes)
        head = [] if count == 1 else [f"{count} mistakes:"]
        _fail([*head, *error.mistakes], BAD_INPUT)


def _chosen(spec: Scenario, case: str, seed: int | None) -> Scenario:
    """The scenario with the cases and the seed of the command line."""
    import msgspec

    from scenarios.spec import suggestion

    if case:
        names = list(dict.fromkeys(name.strip() for name in case.split(",") if name.strip()))
        unknown = [name for name in names if name not in spec.cases]
        if unknown or not names:
            wrong = unknown or [case]
            _fail([f'--case: no case "{name}"; {suggestion(name, spec.cases, "cases")}' for name in wrong], BAD_INPUT)
        spec = msgspec.structs.replace(spec, cases={name: spec.cases[name] for name in spec.cases if name in names})
    return spec if seed is None else msgspec.structs.replace(spec, seed=seed)


def _require(modules: dict[str, str]) -> None:
    """End with a clear line when a package that the run needs is not installed."""
    from importlib.util import find_spec

    packages = {"zenoh": "eclipse-zenoh"}
    missing = [name for name in modules if find_spec(name) is None]
    if missing:
        lines = [f"{packages.get(name, name)} is not installed; {modules[name]} need(s) it" for name in missing]
        _fail([*lines, "install gridpeers with its dependencies: pip install -e ."], BAD_INPUT)


def _fail(lines: list[str], code: int) -> NoReturn:
    for line in lines:
        print(f"gridpeers: {line}", file=sys.stderr)
    raise SystemExit(code)
