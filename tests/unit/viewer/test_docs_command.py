"""`gridpeers docs`: built pages are served to this host; a clone builds them, or says what it needs for that."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest

from gridpeers.viewer import docs_command
from tests.command_line import invoke

SERVE = """
import sys, pathlib
from gridpeers.viewer import docs_command as it
it.SITE, it.CONFIG = pathlib.Path(sys.argv[1]), pathlib.Path("none")
it.docs(port=0, no_browser=True)
"""


def test_built_pages_are_served_until_ctrl_c(tmp_path: Path) -> None:
    """The command prints their address."""
    (tmp_path / "index.html").write_text("the first page", encoding="utf-8")
    command = [sys.executable, "-u", "-c", SERVE, str(tmp_path)]

    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as serving:
        assert serving.stdout is not None
        address = re.search(r"http://127\.0\.0\.1:\d+/", serving.stdout.readline())
        assert address is not None
        with urllib.request.urlopen(address[0]) as answer:
            page = answer.read()
        serving.send_signal(signal.SIGINT)
        _, errors = serving.communicate(timeout=60)

    assert page == b"the first page"
    assert (serving.returncode, errors) == (130, "gridpeers: the documentation has ended\n")


def test_a_clone_without_mkdocs_says_what_to_install(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Nothing is built; pages of an earlier build would be served."""
    monkeypatch.setattr(docs_command, "SITE", tmp_path)
    monkeypatch.setattr(docs_command.util, "find_spec", lambda _: None)

    code, text = invoke("docs", "--port", "0", "--no-browser")

    assert code == 2
    assert text.endswith("install it: pip install -e '.[docs]'\n")
