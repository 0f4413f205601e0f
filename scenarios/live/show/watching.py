"""`gridpeers watch`: a table that renews itself on a terminal, lines elsewhere."""

from __future__ import annotations

from time import monotonic

from rich.console import Console
from rich.live import Live

from scenarios.live.run_client import RunClient
from scenarios.live.run_requests import Watching, present, standing
from scenarios.live.show.keyboard import keyboard
from scenarios.live.show.render import plain, table
from scenarios.live.show.run_monitor import RunMonitor

REFRESH = 0.25
"""Time (s) between two pictures on a terminal: the plant tells five times a second."""

PERIOD = 1.0
"""Time (s) between two texts where the output is no terminal."""

QUIT = ("q", "Q", "\x1b")
"""Keys that end it."""


def watch(client: RunClient, console: Console, seconds: float | None) -> None:
    """Show a run until somebody quits, or for a time.

    Parameters
    ----------
    client : RunClient
        At the run, with its agents met.
    console : Console
        Where to.
    seconds : float or None
        For how long (s); None until q or Ctrl-C.
    """
    monitor = RunMonitor(client.where.run)
    monitor.standing(standing(client))
    watching = Watching(client, monitor)
    end = None if seconds is None else monotonic() + seconds
    if console.is_terminal:
        _on_terminal(client, monitor, watching, console, end)
    else:
        _as_lines(client, monitor, watching, console, end)


def _on_terminal(
    client: RunClient, monitor: RunMonitor, watching: Watching, console: Console, end: float | None
) -> None:
    with keyboard() as key, Live(console=console, screen=True, auto_refresh=False) as live:
        while end is None or monotonic() < end:
            _gather(watching, monotonic() + REFRESH)
            live.update(table(monitor.look(present(client), monotonic())), refresh=True)
            if key(0.0) in QUIT:
                return


def _as_lines(client: RunClient, monitor: RunMonitor, watching: Watching, console: Console, end: float | None) -> None:
    while end is None or monotonic() < end:
        _gather(watching, monotonic() + PERIOD if end is None else min(end, monotonic() + PERIOD))
        text = plain(monitor.look(present(client), monotonic()))
        console.print(text, markup=False, highlight=False, soft_wrap=True)


def _gather(watching: Watching, until: float) -> None:
    while (left := until - monotonic()) > 0.0:
        watching.take(left)
