"""Commands to a live run: look at it, change it, end it. Each imports its modules when it is used, for help at once."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

from gridpeers.cli.commands.options import RUN, As, Connect, Insecure, Keys, Run, Wait, run_client, usage_errors
from gridpeers.cli.usage import BAD_INPUT, BROKEN, fail, terminal
from gridpeers.scenarios.live.run_address import Access


def status(
    run: Run = RUN,
    connect: Connect = None,
    wait: Wait = 5.0,
    keys: Keys = None,
    name: As = "",
    insecure: Insecure = False,
) -> None:
    """Look once at a run: time, pacing, agents, latest events.

    Example:  gridpeers status
    """
    with run_client(run, connect, wait, Access(keys, name, insecure), meet_agents=True) as client:
        from gridpeers.scenarios.live.watching import look, plain

        typer.echo(plain(look(client)), nl=False)


def watch(
    run: Run = RUN,
    connect: Connect = None,
    wait: Wait = 5.0,
    duration: Annotated[
        float | None, typer.Option("--for", metavar="SECONDS", help="Stop after so long; at q if left out.")
    ] = None,
    keys: Keys = None,
    name: As = "",
    insecure: Insecure = False,
) -> None:
    """Watch a run as a live table; q quits. Where the output is no terminal, a text every second.

    Example:  gridpeers watch --keys lab --connect tls/192.168.1.10:7447
    """
    with usage_errors():
        from gridpeers.scenarios.live.run_address import check_duration

        check_duration(duration)
    with run_client(run, connect, wait, Access(keys, name, insecure), meet_agents=True) as client:
        from gridpeers.scenarios.live.watching import watch as watch_run

        watch_run(client, terminal(), duration)


def stop(
    inverter: Annotated[str, typer.Argument(metavar="INVERTER", help="Name of its inverter, e.g. inv2.")],
    run: Run = RUN,
    connect: Connect = None,
    wait: Wait = 5.0,
    keys: Keys = None,
    name: As = "",
    insecure: Insecure = False,
) -> None:
    """Have an agent leave properly: its inverter is switched off.

    The others take over.

    Exit code: 0 it has left, 2 there is no such agent, 3 it has not left.

    Example:  gridpeers stop inv2
    """
    with run_client(run, connect, wait, Access(keys, name, insecure), acts=True) as client:
        from gridpeers.scenarios.live.run_requests import LEAVING, ask, has_left

        typer.echo(ask(client, "stop", inverter))
        if not has_left(client, inverter):
            fail([f"{inverter} has not left within {LEAVING:g} s; is its process frozen?"], BROKEN)


def event(
    action: Annotated[str, typer.Argument(metavar="open|close", help="What to do with the switch.")],
    switch: Annotated[str, typer.Argument(metavar="SWITCH", help='Its name, e.g. "13-152" or "sw1_2".')],
    synchronised: Annotated[
        bool, typer.Option("--synchronised", help="Close only if both sides are in step (IEEE 1547, Table 5).")
    ] = False,
    run: Run = RUN,
    connect: Connect = None,
    wait: Wait = 5.0,
    keys: Keys = None,
    name: As = "",
    insecure: Insecure = False,
) -> None:
    """Open or close a switch of a running plant.

    Exit code: 0 it was done, 2 there is no such switch, or its sides are not in step.

    Example:  gridpeers event close 13-152 --synchronised
    """
    if action not in ("open", "close"):
        fail([f'"{action}" cannot be done to a switch; write open or close'], BAD_INPUT)
    if synchronised and action == "open":
        fail(["--synchronised: only closing can wait for synchronism; leave it out to open a switch"], BAD_INPUT)
    with run_client(run, connect, wait, Access(keys, name, insecure), acts=True) as client:
        from gridpeers.scenarios.live.run_requests import ask

        closing: Literal["close", "synchronise"] = "synchronise" if synchronised else "close"
        typer.echo(ask(client, "open" if action == "open" else closing, switch))


def down(
    run: Run = RUN,
    connect: Connect = None,
    wait: Wait = 5.0,
    keys: Keys = None,
    name: As = "",
    insecure: Insecure = False,
) -> None:
    """End a run: its agents leave, its plant ends.

    Exit code: 0 all have gone, 2 there is no such run, 3 somebody has stayed.

    Example:  gridpeers down --run lab
    """
    with run_client(run, connect, wait, Access(keys, name, insecure), acts=True) as client:
        from gridpeers.scenarios.live.run_requests import LEAVING, ask, has_ended

        typer.echo(ask(client, "down"))
        if not has_ended(client):
            fail([f"the plant has not ended within {LEAVING:g} s; is its process frozen?"], BROKEN)
