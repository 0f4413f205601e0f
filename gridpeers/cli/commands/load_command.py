"""`gridpeers load`: another power for a load of a running plant."""

from __future__ import annotations

from typing import Annotated

import typer

from gridpeers.cli.commands.options import RUN, As, Connect, Insecure, Keys, Run, Wait, run_client, usage_errors
from gridpeers.scenarios.live.run_address import Access


def load(
    name: Annotated[
        str,
        typer.Argument(metavar="LOAD", help='Its bus, e.g. "48"; in an imported feeder its name.'),
    ],
    factor: Annotated[
        float | None,
        typer.Option("--factor", metavar="X", help="Times the power of the feeder's table; 1 is as before."),
    ] = None,
    P: Annotated[float | None, typer.Option("--P", metavar="KW", help="Real power at nominal voltage.")] = None,
    Q: Annotated[float | None, typer.Option("--Q", metavar="KVAR", help="Reactive power at nominal voltage.")] = None,
    run: Run = RUN,
    connect: Connect = None,
    wait: Wait = 5.0,
    keys: Keys = None,
    member: As = "",
    insecure: Insecure = False,
) -> None:
    """Set a load of a running plant.

    It takes the power from the next step on, in all its phases in proportion; of --P and --Q the one that is left out
    stays as it is. In a scenario, load = { 48 = { factor = 1.5 } } in an [[event]] does the same at a time.

    Exit code: 0 it was done, 2 there is no such load, or the number makes no sense.

    Example:  gridpeers load 48 --factor 1.5
    """
    with usage_errors():
        from gridpeers.scenarios.live.run_requests import load_setting

        setting = load_setting(factor, P, Q)
    with run_client(run, connect, wait, Access(keys, member, insecure), acts=True) as client:
        from gridpeers.scenarios.live.run_requests import ask

        typer.echo(ask(client, "load", name, setting))
