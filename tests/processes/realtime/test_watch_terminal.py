"""`gridpeers watch` on a real terminal: the table comes, q ends it, and the terminal is as before."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
from pathlib import Path
from time import monotonic

import pytest

from gridpeers.scenarios.drivers.free_endpoint import free_endpoint
from tests.processes.terminals import Desk

pty = pytest.importorskip("pty")
termios = pytest.importorskip("termios")


def read_until(file: int, wanted: bytes, deadline: float = 80.0) -> bytes:
    """Read from a terminal until something has appeared on it."""
    seen, end = b"", monotonic() + deadline
    while wanted not in seen:
        ready, _, _ = select.select([file], [], [], max(0.0, end - monotonic()))
        assert ready, f"{wanted!r} did not appear; this did: {seen!r}"
        seen += os.read(file, 65536)
    return seen


def test_watch_is_a_table_until_a_key_quits(tmp_path: Path) -> None:
    """The table is on the alternate screen; q and Ctrl-C leave it, and echo is on again."""
    (tmp_path / "calm.toml").write_text('[time]\nend_s = 1.0\n[case.IV]\nsecondary = "all"\ngraph = "full"\n')
    endpoint = free_endpoint()
    with Desk(tmp_path, "--run", "lab") as desk:
        desk.open("plant", "calm.toml", "--listen", endpoint, "--wait", "0").expect("t = 0; speed")
        for key, status in ((b"q", 0), (b"", 130)):
            master, slave = pty.openpty()
            before = termios.tcgetattr(slave)
            words = [sys.executable, "-P", "-c", "from gridpeers.cli.app import main; main()", "watch", "--run", "lab"]
            watch = subprocess.Popen(
                [*words, "--connect", endpoint],
                stdin=slave,
                stdout=slave,
                stderr=slave,
                start_new_session=True,
                env={**os.environ, "TERM": "xterm-256color", "COLUMNS": "150", "LINES": "40"},
            )
            try:
                seen = read_until(master, b"q: quit")
                if key:
                    os.write(master, key)
                else:
                    watch.send_signal(signal.SIGINT)
                read_until(master, b"\x1b[?1049l")  # back from the alternate screen
                code = watch.wait(80)
            finally:
                if watch.poll() is None:
                    watch.kill()
                    watch.wait()
            after = termios.tcgetattr(slave)
            os.close(slave)
            os.close(master)

            assert code == status
            assert b"\x1b[?1049h" in seen
            assert b"inv10" in seen
            assert after == before
