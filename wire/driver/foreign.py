"""Python state of threads that Python did not start.

Zenoh calls us from its own threads. For each call Python 3.11 makes such a thread a state and a stack, and throws them
away after it: a mapping and an unmapping of memory, which every core must be told of. Keeping the first ones saves a
third of the kernel's work in a tick.
"""

from __future__ import annotations

import ctypes
from _thread import get_ident

_kept: set[int] = set()


def keep_thread_state() -> None:
    """Keep the Python state of the calling thread until the thread ends; to be called from a callback, with the GIL.

    An `Ensure` without its `Release`: the count of users never falls to zero, so the state is not thrown away. It holds
    no lock while the thread is elsewhere.
    """
    thread = get_ident()
    if thread not in _kept:
        _kept.add(thread)
        ctypes.pythonapi.PyGILState_Ensure()
