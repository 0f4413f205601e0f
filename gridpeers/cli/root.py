"""The command `gridpeers` as typer has it. A command is imported when it is called, so that help comes at once."""

from __future__ import annotations

from typing import Annotated

import typer

from gridpeers.cli.lazy_commands import LazyCommands

app = typer.Typer(
    cls=LazyCommands,
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


def _version(asked: bool) -> None:
    if asked:
        from importlib.metadata import version

        typer.echo(f"gridpeers {version('gridpeers')}")
        raise typer.Exit


@app.callback()
def gridpeers(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version, and end.")
    ] = False,
) -> None:
    """Peer-to-peer consensus control of microgrid inverters: a plant process and one process per inverter, over Zenoh.

    Example:  gridpeers run islanding
    """
