"""`gridpeers view`: a live run, or the records of one, in the browser."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn
from urllib.parse import quote

import typer

from gridpeers.cli.commands.options import LiveRun, of_live_run
from gridpeers.cli.usage import INTERRUPTED, TERMINATED, fail, require
from gridpeers.scenarios.live.run_address import RUN
from gridpeers.wire.driver.ending import watch_readers

if TYPE_CHECKING:
    from gridpeers.viewer.page_server import Pages

HERE, PORT = "127.0.0.1", 8123  # Address and port of a page by default: on this host alone

Line = Callable[[str], str]  # Makes the line that a command prints, from the address of its page


@of_live_run
def view(
    live: LiveRun,
    record: Annotated[
        Path | None,
        typer.Argument(
            metavar="[RECORD]",
            help="Folder of a recorded run or case, e.g. runs/islanding/latest, or a run.mcap; a live run if left out.",
            show_default=False,
        ),
    ] = None,
    case: Annotated[str, typer.Option(metavar="NAME", help="Case of the RECORD, if it has several.")] = "",
    control: Annotated[
        bool, typer.Option("--control", help="Let the page act: switches, loads, agents, links.")
    ] = False,
    address: Annotated[
        str, typer.Option("--address", metavar="HOST", help="Address of the page; all but the default need a token.")
    ] = HERE,
    port: Annotated[int, typer.Option("--port", metavar="N", help="Port of the page; 0 takes any free one.")] = PORT,
    token: Annotated[
        str, typer.Option("--token", metavar="TEXT", help="Token of the page; a random one if --address needs one.")
    ] = "",
) -> None:
    """Show a run in the browser: feeder, links, strips and agents.

    It shows a live run as it is now, or a RECORD at any time, with the decisions of its agents. Ctrl-C ends the page,
    and not the run.

    Example:  gridpeers view --control
    """
    require(dict.fromkeys(("starlette", "uvicorn", "websockets"), "the page"), "view")
    if record is None:
        if case:
            fail("--case: goes with a RECORD; a live run has one case")
        _serve(lambda: _live(live, control=control), address, port, token)
    if control or live.connect or live.keys or live.run != RUN:
        option = "--control" if control else "--connect" if live.connect else "--keys" if live.keys else "--run"
        fail(f"{option}: needs a live run; a record cannot be changed")
    _serve(lambda: _recorded(record, case), address, port, token)


@contextmanager
def _live(live: LiveRun, *, control: bool) -> Iterator[tuple[Pages, Line]]:
    with live.client(meet_agents=True, acts=control) as client:
        from gridpeers.viewer.live_pages import LivePages, looks_only
        from gridpeers.viewer.run_follower import RunFollower

        rights = "" if control else f"; {looks_only(client.where.credentials)}"
        with RunFollower(client) as follower:
            yield (
                LivePages(follower, client.where, control=control),
                lambda url: f"run {live.run}: open {url} in a browser{rights}; Ctrl-C ends the page, not the run",
            )


@contextmanager
def _recorded(path: Path, case: str) -> Iterator[tuple[Pages, Line]]:
    require({"mcap": "the record of a run"})
    from gridpeers.scenarios.record.record_file import record_path
    from gridpeers.viewer.record_pages import RecordedRun, RecordPages

    path = record_path(path, case).parent if case else path
    recorded = RecordedRun(path)
    yield RecordPages(recorded), lambda url: f"record {path}: open {url} in a browser; Ctrl-C ends the page"


def _serve(
    pages: Callable[[], AbstractContextManager[tuple[Pages, Line]]], address: str, port: int, token: str
) -> NoReturn:
    from gridpeers.viewer.page_server import access, listen, url_of

    token, hosts = access(address, token)
    listening = listen(address, port)  # first: a port in use is told at once
    with listening, pages() as (shown, line):
        from gridpeers.viewer.page_server import PageServer
        from gridpeers.wire.driver.drive import StoppedError

        watch_readers(quits=False)
        signal = "SIGINT"
        typer.echo(line(url_of(listening, address) + (f"?token={quote(token, safe='')}" if token else "")))
        try:
            PageServer(shown, token, hosts).run(listening)
        except (KeyboardInterrupt, StoppedError) as stop:
            signal = str(stop) or "SIGINT"
        finished = f"{signal}: the page has ended"
    fail(finished, code=TERMINATED if signal == "SIGTERM" else INTERRUPTED)
