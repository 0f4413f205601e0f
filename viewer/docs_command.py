"""`gridpeers docs`: the pages of the documentation in the browser, without a network."""

from __future__ import annotations

import os
import subprocess
import sys
import webbrowser
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from importlib import util
from pathlib import Path
from typing import Annotated, Any

import typer

from gridpeers.cli.usage import BROKEN, exit_code, fail, flag, interruptible, option, require
from gridpeers.viewer.page_server import listen, url_of

SITE, CONFIG = Path(__file__).with_name("site"), Path(__file__).parents[2] / "mkdocs.yml"
"""The built pages, which a wheel brings, and the file from which a clone builds them."""


def docs(
    port: Annotated[int, option("N", "Port of the pages; 0 takes any free one.")] = 8124,
    no_browser: Annotated[bool, flag("Print the address, and open no browser.", "--no-browser")] = False,
) -> None:
    """Show the documentation in the browser, offline.

    Only this host reaches the pages. In a clone of the repository, the command builds them first. Ctrl-C ends it.

    Example:  gridpeers docs
    """
    with interruptible(), listen("127.0.0.1", port) as listening:
        try:
            if CONFIG.is_file():
                _build()
            if not (SITE / "index.html").is_file():
                fail("this installation lacks the pages; a clone builds them: pip install -e '.[docs]'")
            url = url_of(listening, "127.0.0.1")
            typer.echo(f"documentation: open {url} in a browser, or {url}learn/first-run.html; Ctrl-C ends the command")
            if not no_browser and (sys.platform != "linux" or {"DISPLAY", "WAYLAND_DISPLAY"} & os.environ.keys()):
                webbrowser.open(url)  # without a display it would take the terminal
            server = ThreadingHTTPServer(
                ("127.0.0.1", 0), partial(_Quiet, directory=str(SITE)), bind_and_activate=False
            )
            server.socket.close()
            server.socket = listening
            server.serve_forever()
        except KeyboardInterrupt as stop:
            fail("the documentation has ended", code=exit_code(stop))


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_: Any) -> None:
        """Print nothing of a request."""


def _build() -> None:
    """Build the pages of a clone; those of an earlier build serve where mkdocs is not installed."""
    if util.find_spec("material") is None and (SITE / "index.html").is_file():
        return
    require({"material": "the pages of a clone"}, "docs")
    typer.echo("building the pages, which takes some seconds ...")
    words = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--no-strict", "--config-file", str(CONFIG)]
    env = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(words, env=env, capture_output=True, text=True, check=False)
    if done.returncode:
        fail("the pages cannot be built:", *done.stderr.strip().splitlines()[-5:], code=BROKEN)
