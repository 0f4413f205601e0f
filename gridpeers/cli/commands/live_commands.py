"""Commands that look at a live run, change it or end it, and the command `agent`, which joins one.

People wait for them: what only one of them needs is imported when it is called.
"""

from __future__ import annotations

from typing import Annotated, Literal

import typer

from gridpeers.cli.commands.options import (
    Connect,
    Insecure,
    Keys,
    LiveRun,
    Run,
    Wait,
    address,
    check_open,
    finish,
    of_live_run,
)
from gridpeers.cli.usage import BROKEN, argument, fail, flag, option, require_posix, terminal
from gridpeers.scenarios.drivers.free_endpoint import free_endpoint
from gridpeers.scenarios.live.run_address import (
    RUN,
    Access,
    UsageError,
    check_duration,
    check_endpoint,
    check_inverters,
    check_wait,
)
from gridpeers.scenarios.live.run_requests import LEAVING, ask, has_ended, has_left, load_setting
from gridpeers.wire.driver.ending import watch_readers


def agent(
    inverters: Annotated[list[str], argument("INVERTER", "Inverters, e.g. inv2; also spare ones.")],
    run: Run = RUN,
    connect: Connect = None,
    listen: Annotated[
        list[str] | None, option("ENDPOINT", "Endpoint for other agents; a free port if left out.")
    ] = None,
    wait: Wait = 60.0,
    keys: Keys = None,
    insecure: Insecure = False,
    own_code: Annotated[
        bool, flag("Run your own law, graph or link fault if a plant on another host names it.", "--own-code")
    ] = False,
) -> None:
    """Run the agent of an inverter, or of several, in this terminal.

    At Ctrl-C the agents leave, and their inverters are switched off.

    Example:  gridpeers agent inv2 --keys lab --connect tls/192.168.1.10:7447
    """
    require_posix("a live run")
    from gridpeers.scenarios.live.live_processes import agent_here

    check_inverters(inverters)
    if keys is not None and len(inverters) > 1:
        raise UsageError(f"--keys: a process has one certificate; start the agent of {inverters[1]} in its own")
    where = address(run, connect, access := Access(keys=keys, insecure=insecure), ("agent",), inverters[0])
    for text in listen or ():
        check_open("--listen", check_endpoint("--listen", text), access)
    check_wait(wait)
    watch_readers(quits=False)
    listening = tuple(free_endpoint(text, option="--listen") for text in listen or ())
    finish(agent_here(where, tuple(inverters), listening or None, wait, trusts=own_code))


@of_live_run
def status(live: LiveRun) -> None:
    """Show a run once: time, pace, agents, latest events.

    Example:  gridpeers status
    """
    from gridpeers.scenarios.live import watching

    with live.client(meet_agents=True) as client:
        typer.echo(watching.plain(watching.look(client)), nl=False)


@of_live_run
def watch(
    live: LiveRun,
    duration: Annotated[float | None, option("SECONDS", "End after this time; at Ctrl-C if left out.", "--for")] = None,
) -> None:
    """Watch a run as a live table, until Ctrl-C. Outside a terminal, print a text every second.

    Example:  gridpeers watch --keys lab --connect tls/192.168.1.10:7447
    """
    from gridpeers.scenarios.live import watching

    check_duration(duration)
    with live.client(meet_agents=True) as client:
        watching.watch(client, terminal(), duration)


@of_live_run
def stop(inverter: Annotated[str, argument("INVERTER", "Inverter of the agent, e.g. inv2.")], live: LiveRun) -> None:
    """Make an agent leave: its inverter is switched off.

    The others take its load.

    Example:  gridpeers stop inv2
    """
    with live.client(acts=True) as client:
        typer.echo(ask(client, "stop", inverter))
        if not has_left(client, inverter):
            fail(f"{inverter} has not left within {LEAVING:g} s; is its process frozen?", code=BROKEN)


@of_live_run
def event(
    action: Annotated[Literal["open", "close"], argument("open|close", "Operation of the switch.")],
    switch: Annotated[str, argument("SWITCH", 'Name of the switch, e.g. "13-152" or "sw1_2".')],
    live: LiveRun,
    synchronised: Annotated[
        bool, flag("Close only when both sides are in synchronism (IEEE 1547, Table 5).", "--synchronised")
    ] = False,
) -> None:
    """Open or close a switch of a running plant.

    Example:  gridpeers event close 13-152 --synchronised
    """
    if synchronised and action == "open":
        fail("--synchronised: goes with close; leave it out to open a switch")
    with live.client(acts=True) as client:
        typer.echo(ask(client, "synchronise" if synchronised else action, switch))


@of_live_run
def load(
    name: Annotated[str, argument("LOAD", 'Bus of the load, e.g. "48"; in an imported feeder, its name.')],
    live: LiveRun,
    factor: Annotated[float | None, option("X", "Factor on the power of the feeder's table; 1 restores it.")] = None,
    P: Annotated[float | None, option("KW", "Real power at nominal voltage.", "--P")] = None,
    Q: Annotated[float | None, option("KVAR", "Reactive power at nominal voltage.", "--Q")] = None,
) -> None:
    """Set a load of a running plant.

    The power changes at the next step, in all phases in proportion. A power that is not given stays. In a scenario,
    load = { 48 = { factor = 1.5 } } in an [[event]] does the same.

    Example:  gridpeers load 48 --factor 1.5
    """
    setting = load_setting(factor, P, Q)
    with live.client(acts=True) as client:
        typer.echo(ask(client, "load", name, setting))


@of_live_run
def down(live: LiveRun) -> None:
    """End a run: its agents leave, its plant ends.

    Example:  gridpeers down --run lab
    """
    with live.client(acts=True) as client:
        typer.echo(ask(client, "down"))
        if not has_ended(client):
            fail(f"the plant has not ended within {LEAVING:g} s; is its process frozen?", code=BROKEN)
