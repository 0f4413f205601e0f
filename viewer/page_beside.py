"""The page beside a run (`gridpeers run --view`): it follows the run's records, and stays until Ctrl-C."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from gridpeers.cli.usage import BAD_INPUT, fail, interruptible, require

if TYPE_CHECKING:
    import socket

HERE, PORT = "127.0.0.1", 8123
"""Where a page is opened if nothing else is said: on this host alone."""


def require_page() -> None:
    """End with a clear line if the packages of the page are not installed."""
    modules = dict.fromkeys(("starlette", "uvicorn", "websockets"), "the page")
    require(modules, "install it: pip install 'gridpeers[view]'")


def page_socket(port: int | None) -> socket.socket:
    """Return a socket for the page; or end with a clear line, before anything is started."""
    require_page()
    from gridpeers.scenarios.live.run_address import UsageError
    from gridpeers.viewer.page_address import listen

    try:
        return listen(HERE, PORT if port is None else port)
    except UsageError as error:
        fail([str(error)], BAD_INPUT)


@contextmanager
def page_beside(folder: Path, listening: socket.socket, name: str) -> Iterator[None]:
    """Open the page of a run folder on a socket; after a run that ended well wait for Ctrl-C."""
    from gridpeers.viewer.page_address import url_of
    from gridpeers.viewer.recorded.page_process import PageProcess

    url = url_of(listening, HERE)
    with PageProcess(folder, listening) as page:
        typer.echo(f"{name}: open {url} in a browser; the page follows the run, and stays until Ctrl-C")
        yield
        typer.echo(f"the run has ended; {url} shows its record until Ctrl-C")
        with suppress(KeyboardInterrupt), interruptible():
            page.wait()
