"""The command `gridpeers feeder glm`: a feeder as a model for GridLAB-D."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gridpeers.cli.usage import BAD_INPUT, check_choice, fail, load, refuse

if TYPE_CHECKING:
    from gridpeers.plant.equipment import Feeder
    from gridpeers.plant.plant_config import PlantSettings


def glm(
    feeder: Annotated[
        str, typer.Argument(metavar="FEEDER", help="A feeder that comes with gridpeers, or a folder of tables.")
    ],
    out: Annotated[Path | None, typer.Option("--out", help="File of the model; else FEEDER.glm here.")] = None,
    load_set: Annotated[
        str | None, typer.Option("--load-set", help="Load table; else main, or the scenario's.")
    ] = None,
    scenario: Annotated[
        str | None, typer.Option("--scenario", help="Inverters' parameters, set-points and changes of this scenario.")
    ] = None,
    case: Annotated[str | None, typer.Option("--case", help="Case of the scenario; else its first.")] = None,
    seconds: Annotated[int, typer.Option("--seconds", min=1, max=50, help="Length of the run (s).")] = 5,
) -> None:
    """Write a feeder as a model that GridLAB-D runs by itself: in delta mode if it has inverters.

    Exit code: 0 it was written, 2 it cannot be; all reasons are named.

    Example:  gridpeers feeder glm microgrid123 --scenario islanding --out islanding.glm
    """
    from tempfile import gettempdir

    from gridpeers.feeder import reader_of
    from gridpeers.plant.dynamics import PlantError
    from gridpeers.plant.tables import FeederError
    from gridpeers.rooms import ROOMS
    from gridpeers.scenarios.results.run_files import refusal, shown, write_whole

    if reader_of(feeder):
        fail([f"{feeder}: no feeder of our own tables; only those can be written for GridLAB-D"], BAD_INPUT)
    if case is not None and scenario is None:
        fail(["--case: is a case of a scenario; name it with --scenario"], BAD_INPUT)
    tables, settings = _of_scenario(feeder, scenario, case, load_set) if scenario else _own(feeder, load_set)
    file = out or Path(f"{tables.name}.glm")
    try:
        text = ROOMS.resolve("export_glm")(tables, settings, seconds, f"{file.stem}_voltages.csv")
    except FeederError as error:
        refuse(error)
    except PlantError as error:
        fail([f"{feeder}: {error}"], BAD_INPUT)
    except OSError as error:  # of the tables that it is made from
        fail([refusal(Path(gettempdir()), error)], BAD_INPUT)
    try:
        write_whole(file, text)
    except OSError as error:
        fail([refusal(file, error)], BAD_INPUT)
    typer.echo(f"Model: {shown(file)}; GridLAB-D writes the voltages of its start to {file.stem}_voltages.csv")


def _own(name: str, load_set: str | None) -> tuple[Feeder, PlantSettings]:
    """Return a feeder and the default settings, or end with every problem of its tables."""
    from gridpeers.plant.plant_config import PlantSettings
    from gridpeers.plant.tables import FeederError, read_feeder

    try:
        return read_feeder(name, load_set or "main"), PlantSettings(feeder=name)
    except FeederError as error:
        refuse(error)


def _of_scenario(name: str, scenario: str, case: str | None, load_set: str | None) -> tuple[Feeder, PlantSettings]:
    """Return a scenario's feeder, with its changes, and its settings; or end if it is on another feeder."""
    from gridpeers.scenarios.schema.configs import configs

    spec, feeder = load(scenario, {"plant.load_set": load_set} if load_set else {})
    if name != spec.plant.feeder and Path(name).resolve() != Path(spec.plant.feeder).resolve():
        fail([f'--scenario: "{scenario}" is on feeder "{spec.plant.feeder}", not on "{name}"'], BAD_INPUT)
    if case is not None:
        check_choice("--case: ", "case", case, tuple(spec.cases))
    return feeder, configs(spec, feeder, case or next(iter(spec.cases)))[0].settings
