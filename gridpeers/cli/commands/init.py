"""The command `gridpeers init`: a project of one's own, from a template that runs as it is."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Annotated

import typer

from gridpeers.cli.usage import BAD_INPUT, fail

TEMPLATE = Path(__file__).parents[1] / "template"
"""Folder that is copied."""


def init(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of the project, new or empty.")],
) -> None:
    """Make a project of your own: a law, a scenario and a test.

    Exit code: 0 it was made, 2 the folder cannot be used.

    Example:  gridpeers init my-study
    """
    import shlex

    from scenarios.results.run_files import refusal, shown

    try:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            kind = "the folder is not empty" if folder.is_dir() else "this is a file"
            fail([f"{folder}: {kind}; give a new or an empty folder"], BAD_INPUT)
        shutil.copytree(TEMPLATE, folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__"))
    except OSError as error:
        fail([refusal(folder, error)], BAD_INPUT)
    for file in sorted(path.name for path in folder.iterdir()):
        typer.echo(f"{shown(folder / file)}")
    typer.echo(f"Next:  cd {shlex.quote(str(folder))} && gridpeers run mine.toml --driver inprocess && pytest")
