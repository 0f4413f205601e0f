"""The command `gridpeers`. A command is imported when it is called, so that help comes at once.

Exit codes: 0 all is well, 1 a claim of the paper failed, 2 bad usage, a bad file, or output that cannot be written,
3 the run broke, 130 interrupted by Ctrl-C, 141 nobody reads the output any more, 143 by SIGTERM.
"""

from __future__ import annotations

import os
from typing import Annotated

import typer

from gridpeers.cli.lazy_commands import LazyCommands
from gridpeers.cli.usage import BAD_INPUT, BROKEN, INSTALL, INTERRUPTED, fail
from wire.driver.leftover import leave
from wire.driver.output import speaking

app = typer.Typer(
    cls=LazyCommands,
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


def main() -> None:
    """Run the command line; no bad input ends in a traceback."""
    try:
        _main()
    except SystemExit as end:
        leave(end.code if isinstance(end.code, int) else int(end.code is not None), _tell)
        raise


def _tell(line: str) -> None:
    typer.echo(f"gridpeers: {line}", err=True)


def _main() -> None:
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
