"""End a process at once: Python alone would wait for ever for threads of foreign code, and look through all objects."""

from __future__ import annotations

import atexit
import gc
import os
import threading
from collections.abc import Callable
from time import monotonic

from gridpeers.wire.driver.output import flush_output

GRACE = 1.0
"""Time (s) for such threads to end by themselves."""


def leave(status: int, tell: Callable[[str], None]) -> None:
    """Return if no thread keeps the process alive, for Python to end; else end the process.

    Parameters
    ----------
    status : int
        Exit status of the process.
    tell : Callable[[str], None]
        Logs a sentence on the threads that still run.
    """
    gc.freeze()  # Python would seek garbage twice at its end: 0.2 s of a command, and 20 ms of each agent
    deadline = monotonic() + GRACE
    own = (threading.main_thread(), threading.current_thread())
    left = [thread for thread in threading.enumerate() if not thread.daemon and thread not in own]
    for thread in left:
        thread.join(max(0.0, deadline - monotonic()))
    if still := [thread.name for thread in left if thread.is_alive()]:
        tell(f"ended although threads still ran that were started in it: {', '.join(still)}; make them daemons")
        atexit._run_exitfuncs()  # noqa: SLF001  Python would do this once they had ended
        flush_output()
        os._exit(status)
