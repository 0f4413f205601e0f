"""How the kernel schedules a process of a run."""

from __future__ import annotations

import os


def schedule_as_batch() -> None:
    """Have this thread, and those that it starts from now on, not interrupt others as they wake.

    In simulated time nothing is due at an instant, but every message wakes several threads. Where these take a core
    from a thread that computes, all wait for it: about a tenth of a tick with three agents a process on two cores,
    nothing that could be measured with one. Nothing is done where the system knows no such policy, nor where the user
    has chosen one (`chrt`).
    """
    if hasattr(os, "SCHED_BATCH") and os.sched_getscheduler(0) == os.SCHED_OTHER:
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
