"""Keep the Python state of threads that Python did not start.

Zenoh calls us from its own threads. For each call Python 3.11 creates a state and a stack for the thread, and discards
them afterwards: this maps and unmaps memory, which interrupts every processor core. Keeping the first ones saves a
third of the kernel's work in a tick.
"""

from __future__ import annotations

import ctypes
from _thread import get_ident

_kept: set[int] = set()


def keep_thread_state() -> None:
    """Keep the Python state of the calling thread until the thread ends; call it from a callback, with the GIL.

    This is an `Ensure` without its `Release`: the count of users never falls to zero, so Python keeps the state. It
    holds no lock while the thread is outside of Python.
    """
    thread = get_ident()
    if thread not in _kept:
        _kept.add(thread)
        ctypes.pythonapi.PyGILState_Ensure()
