"""The page beside a run (`gridpeers run --view`): it follows the run's records, and stays until Ctrl-C.

It is served by a process of its own: the run must not wait for it, least of all in real time.
"""

from __future__ import annotations

import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import msgspec
import typer

from gridpeers.cli.usage import BAD_INPUT, fail, interruptible, require

HERE, PORT = "127.0.0.1", 8123
"""Address and port of a page by default: on this host alone."""

LEAVING = 5.0


def require_page() -> None:
    modules = dict.fromkeys(("starlette", "uvicorn", "websockets"), "the page")
    require(modules, "install it: pip install 'gridpeers[view]'")


def page_socket(port: int | None) -> socket.socket:
    require_page()
    from gridpeers.scenarios.live.run_address import UsageError
    from gridpeers.viewer.page_server import listen

    try:
        return listen(HERE, PORT if port is None else port)
    except UsageError as error:
        fail([str(error)], BAD_INPUT)


@contextmanager
def page_beside(folder: Path, listening: socket.socket, name: str) -> Iterator[None]:
    """Open the page of a run folder on a socket; after a run that ended well wait for Ctrl-C."""
    from gridpeers.viewer.page_server import url_of

    url = url_of(listening, HERE)
    with _process(folder, listening) as page:
        typer.echo(f"{name}: open {url} in a browser; the page follows the run, and stays until Ctrl-C")
        yield
        typer.echo(f"the run has ended; {url} shows its record until Ctrl-C")
        with suppress(KeyboardInterrupt), interruptible():
            page.wait()


class PageConfig(msgspec.Struct, frozen=True, kw_only=True):
    path: str
    descriptor: int


@contextmanager
def _process(folder: Path, listening: socket.socket) -> Iterator[subprocess.Popen[bytes]]:
    from gridpeers.wire.driver.process import LEASH

    config = PageConfig(path=str(folder), descriptor=listening.fileno())
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "gridpeers.viewer.page_beside", LEASH, "view"],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        pass_fds=(config.descriptor,),
        start_new_session=True,  # Ctrl-C is for the command, which ends the page
    )
    listening.close()
    assert process.stdin is not None
    try:
        with suppress(BrokenPipeError):  # it has ended already
            process.stdin.write(msgspec.json.encode(config) + b"\n")
            process.stdin.flush()
        yield process
    finally:
        with suppress(BrokenPipeError):
            process.stdin.close()  # which ends it
        try:
            process.wait(LEAVING)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def serve(config: PageConfig) -> str:
    from gridpeers.viewer.page_server import PageServer
    from gridpeers.viewer.record_pages import RecordedRun, RecordPages

    with socket.socket(fileno=config.descriptor) as listening:
        PageServer(RecordPages(RecordedRun(Path(config.path)))).run(listening)
    return ""


if __name__ == "__main__":
    from gridpeers.wire.driver.process import main

    sys.exit(main("gridpeers.viewer.page_beside", "Serve the page of a run that is recorded.", PageConfig, serve))
