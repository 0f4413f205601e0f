"""The page beside a run (`gridpeers run --view`): it follows the run's records, and stays until Ctrl-C."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from gridpeers.cli.usage import BAD_INPUT, fail, require_page

if TYPE_CHECKING:
    import socket

HERE, PORT = "127.0.0.1", 8123
"""Where a page is opened if nothing else is said: on this host alone."""


def page_socket(port: int | None) -> socket.socket:
    """Return a socket for the page; or end with a clear line, before anything is started."""
    require_page()
    from gridpeers.scenarios.live.client.run_address import UsageError
    from gridpeers.scenarios.view.page_address import listen

    try:
        return listen(HERE, PORT if port is None else port)
    except UsageError as error:
        fail([str(error)], BAD_INPUT)


@contextmanager
def page_beside(folder: Path, listening: socket.socket | None, name: str) -> Iterator[None]:
    """Open the page of a run folder, if there is a socket for it; after a run that ended well wait for Ctrl-C."""
    if listening is None:
        yield
        return
    from gridpeers.cli.interruption import interruptible
    from gridpeers.scenarios.view.page_address import url_of
    from gridpeers.scenarios.view.recorded.page_process import PageProcess

    url = url_of(listening, HERE)
    with PageProcess(folder, listening) as page:
        typer.echo(f"{name}: open {url} in a browser; the page follows the run, and stays until Ctrl-C")
        yield
        typer.echo(f"the run has ended; {url} shows its record until Ctrl-C")
        with suppress(KeyboardInterrupt), interruptible():
            page.wait()
