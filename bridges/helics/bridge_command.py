"""The command `gridpeers bridge helics`: our plant for controllers of others."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from gridpeers.cli.commands.run_command import carry_out
from gridpeers.cli.usage import BAD_INPUT, ScenarioName, check_choice, chosen, fail, load

if TYPE_CHECKING:
    from gridpeers.scenarios.schema import ScenarioModel

app = typer.Typer(no_args_is_help=True, rich_markup_mode=None, help="Offer our plant to simulators of others.")

NAME = "gridpeers-plant"
"""Name of the bridge's federate: not that of `gridpeers run --plant helics`, so that the two can meet."""


@app.callback()
def bridge() -> None:
    """Offer our plant to simulators of others."""  # with one command alone, typer would leave out its name


@app.command()
def helics(
    scenario: ScenarioName,
    case: Annotated[
        str | None, typer.Option(help="Case to run; the scenario's last when left out.", metavar="NAME")
    ] = None,
    outside: Annotated[
        str, typer.Option(metavar="NAMES", help="Inverters that others control: all, none, or e.g. inv1,inv4.")
    ] = "all",
    plant: Annotated[
        Literal["gridpeers", "gridlabd"] | None,
        typer.Option(help="What simulates the plant; as the scenario says when left out."),
    ] = None,
    broker: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="The HELICS broker, tcp://127.0.0.1:23404 when left out.")
    ] = None,
    start_broker: Annotated[
        bool, typer.Option("--start-broker", help="Start the broker here, at that address.")
    ] = False,
    federates: Annotated[
        int, typer.Option(min=2, metavar="N", help="With --start-broker: federates to wait for, this one included.")
    ] = 2,
    name: Annotated[str, typer.Option(metavar="NAME", help="Name of this federate.")] = NAME,
    driver: Annotated[
        Literal["processes", "inprocess"], typer.Option(help="Where our own agents and the plant run, as in run.")
    ] = "inprocess",
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder for the results, new or empty; runs/SCENARIO/TIME when left out."),
    ] = None,
) -> None:
    """Run a scenario as a HELICS federate: publish the measurements of its plant, and follow set-points of others.

    Inverters that nobody outside controls have our agents (--outside). Topics, units and timing: docs/helics.md.
    Exit codes are those of run.

    Example:  gridpeers bridge helics islanding --case IV --start-broker
    """
    changes: dict[str, Any] = {"plant.helics.name": name}
    if plant is not None:
        changes["plant.simulator"] = plant
    if broker is not None:
        changes["plant.helics.broker"] = broker
    if start_broker:
        changes["plant.helics.federates"] = federates
    spec, feeder = load(scenario, changes)
    if spec.plant.simulator == "helics":
        fail(['plant.simulator = "helics": a plant from outside cannot be bridged; use "gridpeers"'], BAD_INPUT)
    case = case or list(spec.cases)[-1]
    spec = chosen(spec, case, None)
    if len(spec.cases) > 1:
        fail([f"--case: a HELICS federation runs once, so choose one case, got {case}"], BAD_INPUT)
    known = [row.name for row in feeder.inverters]
    carry_out(spec, feeder, driver, out, {}, bridge="helics", outside=_outside(outside, known, spec))


def _outside(text: str, known: list[str], spec: ScenarioModel) -> tuple[str, ...]:
    listed = [name.strip() for name in text.split(",")]
    names = known if text == "all" else [] if text == "none" else listed
    for name in names:
        check_choice("--outside: ", "inverter", name, ["all", "none", *known])
    problems = [
        f'event "{event.label}": {", ".join(moving)} leaves or joins with an agent of ours; see --outside'
        for event in spec.events
        if (moving := sorted({*event.leave, *event.join}.intersection(names)))
    ]
    if problems:
        fail(problems, BAD_INPUT)
    return tuple(names)
