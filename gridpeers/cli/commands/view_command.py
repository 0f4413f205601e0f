"""`gridpeers view`: a run in the browser."""

from __future__ import annotations

from typing import Annotated

import typer

from gridpeers.cli.commands.options import RUN, Connect, Run, Wait, run_client, usage_errors
from gridpeers.cli.usage import INTERRUPTED, TERMINATED, fail, require
from wire.driver.output import watch_readers


def view(
    run: Run = RUN,
    connect: Connect = None,
    wait: Wait = 5.0,
    control: Annotated[
        bool, typer.Option("--control", help="Let the page switch, stop and start agents, cut and heal links.")
    ] = False,
    address: Annotated[
        str, typer.Option("--address", metavar="HOST", help="Where the page listens; any other asks for a token.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option("--port", metavar="N", help="Port of the page; 0 takes any free one.")] = 8123,
    token: Annotated[
        str, typer.Option("--token", metavar="TEXT", help="What a page must know; made up for other addresses.")
    ] = "",
) -> None:
    """Show a run in the browser: feeder, links, strips and agents. Ctrl-C ends it, and not the run.

    Exit code: 2 bad usage, or nobody there, 130 Ctrl-C, 143 SIGTERM.

    Example:  gridpeers view --control
    """
    modules = dict.fromkeys(("starlette", "uvicorn", "websockets"), "the page")
    require(modules, "install it: pip install 'gridpeers[view]'")
    with usage_errors():
        import secrets

        from scenarios.view.page_address import is_this_host, listen, url_of

        listening = listen(address, port)  # first: a port in use is told at once
    with listening, run_client(run, connect, wait, meet_agents=True) as client:
        from scenarios.view.page_server import PageOptions, PageServer
        from scenarios.view.run_follower import RunFollower
        from wire.driver.drive import StoppedError

        here = is_this_host(address)
        token = token or ("" if here else secrets.token_urlsafe(16))
        hosts = ("127.0.0.1", "localhost", "[::1]", address) if here else ()
        options = PageOptions(where=client.where, control=control, token=token, hosts=hosts)
        url = url_of(listening, address) + (f"?token={token}" if token else "")
        watch_readers(quits=False)
        signal = "SIGINT"
        with RunFollower(client) as follower:
            rights = "" if control else "; it only looks (--control lets it act)"
            typer.echo(f"run {run}: open {url} in a browser{rights}; Ctrl-C ends the page, not the run")
            try:
                PageServer(follower, options).run(listening)
            except (KeyboardInterrupt, StoppedError) as stop:
                signal = str(stop) or "SIGINT"
        fail([f"{signal}: the page has ended"], TERMINATED if signal == "SIGTERM" else INTERRUPTED)
