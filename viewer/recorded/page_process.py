"""A page beside a run, in a process of its own: the run must not wait for it, least of all in real time."""

from __future__ import annotations

import contextlib
import socket
import subprocess
import sys
from pathlib import Path
from types import TracebackType

import msgspec

from gridpeers.viewer.page_server import PageOptions, PageServer
from gridpeers.viewer.recorded.record_pages import RecordPages
from gridpeers.viewer.recorded.recorded_run import RecordedRun
from gridpeers.wire.driver.process import LEASH

LEAVING = 5.0
"""Time (s) that the process has to end by itself."""


class PageConfig(msgspec.Struct, frozen=True, kw_only=True):
    """Configuration of the process (JSON on its standard input)."""

    path: str
    """Folder of the run."""
    descriptor: int
    """File descriptor of the socket on which the page is opened."""
    hosts: tuple[str, ...]
    """Names in the address of the page."""


def serve(config: PageConfig) -> str:
    """Serve the page until a signal comes."""
    with socket.socket(fileno=config.descriptor) as listening:
        pages = RecordPages(RecordedRun(Path(config.path)))
        PageServer(pages, PageOptions(hosts=config.hosts)).run(listening)
    return ""


class PageProcess:
    """The process, for the command beside which it runs. Leaving the context ends it; so does the command's death.

    Parameters
    ----------
    folder : Path
        Folder of the run, which says that it goes on.
    listening : socket.socket
        Where the page is opened; the process takes it over.
    """

    def __init__(self, folder: Path, listening: socket.socket) -> None:
        descriptor = listening.fileno()
        config = PageConfig(path=str(folder), descriptor=descriptor, hosts=PageOptions().hosts)
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "gridpeers.viewer.recorded", LEASH, "view"],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=(descriptor,),
            start_new_session=True,  # Ctrl-C is for the command, which ends the page
        )
        listening.close()
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # it has ended already
            self._process.stdin.write(msgspec.json.encode(config) + b"\n")
            self._process.stdin.flush()

    def __enter__(self) -> PageProcess:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.close()  # which ends it
        try:
            self._process.wait(LEAVING)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def wait(self) -> None:
        """Wait until it ends, or until Ctrl-C."""
        self._process.wait()
