"""Threads that somebody's code has left running hold up no process."""

import subprocess
import sys

import pytest

SCRIPT = """
import threading
from gridpeers.wire.driver.leftover import leave
threading.Thread(target=threading.Event().wait, name="forgotten", daemon={daemon}).start()
leave(3, print)
print("returned")
"""


@pytest.mark.parametrize(("daemon", "status", "said"), [
    (False, 3, "ended although threads still ran that were started in it: forgotten; make them daemons"),
    (True, 0, "returned"),
])  # fmt: skip
def test_a_thread_that_never_ends_is_named_and_left(daemon: bool, status: int, said: str) -> None:
    """The exit status is that of the process; one that Python does not wait for is no concern."""
    script = SCRIPT.format(daemon=daemon)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=30.0)

    assert (done.returncode, done.stdout.strip()) == (status, said)
