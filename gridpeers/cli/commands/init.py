"""The command `gridpeers init`: a project of your own, from a template that runs unchanged."""

from __future__ import annotations

import shlex
import shutil
from pathlib import Path
from typing import Annotated

import typer

from gridpeers.cli.usage import LeaveOut, Switches, argument, fail, option
from gridpeers.output_folders import shown, whole_folder
from gridpeers.rooms import ROOMS
from gridpeers.wire.driver.command_line import command_line

TEMPLATE = Path(__file__).parents[1] / "template"  # Folder that is copied


def init(
    folder: Annotated[Path, argument("DIR", "Folder of the project, new or empty.")],
    feeder: Annotated[Path | None, option("FILE", "Feeder to island, a .dss or .glm file.", "--feeder")] = None,
    switch: Switches = None,
    leave_out: LeaveOut = None,
) -> None:
    """Start a project: a law of your own, or an islanding of your feeder.

    The project has a law, a scenario and a test. With --feeder it has the tables of the feeder, inverters and a
    scenario.

    Example:  gridpeers init my-study --feeder Master.dss
    """
    if feeder is None and (switch or leave_out):
        fail("--switch and --leave-out need --feeder")
    with whole_folder(folder):
        if feeder is None:
            shutil.copytree(TEMPLATE, folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            ROOMS.resolve("propose_project")(folder, feeder, switch or [], leave_out or [])
    following = command_line("run", "islanding.toml" if feeder else "mine.toml", "--driver", "inprocess")
    for file in sorted(path.name for path in folder.iterdir()):
        typer.echo(f"{shown(folder / file)}")
    typer.echo(f"Next:  cd {shlex.quote(str(folder))} && {following}")
