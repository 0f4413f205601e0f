"""How the kernel schedules a process."""

from __future__ import annotations

import os
import threading

import pytest

from gridpeers.wire.driver.machine import schedule_as_batch

with_policies = pytest.mark.skipif(not hasattr(os, "SCHED_BATCH"), reason="this system knows no such policy")


def policies(before: int) -> tuple[int, int]:
    found: list[int] = []

    def thread() -> None:
        os.sched_setscheduler(0, before, os.sched_param(0))
        schedule_as_batch()
        found.append(os.sched_getscheduler(0))
        inner = threading.Thread(target=lambda: found.append(os.sched_getscheduler(0)))
        inner.start()
        inner.join()

    outer = threading.Thread(target=thread)
    outer.start()
    outer.join()
    return found[0], found[1]


@with_policies
def test_a_thread_and_those_it_starts_become_batch_work() -> None:
    """Zenoh's threads, which start later, are scheduled as the agent that opens the session."""
    assert policies(os.SCHED_OTHER) == (os.SCHED_BATCH, os.SCHED_BATCH)


@with_policies
def test_a_policy_that_the_user_has_chosen_stays() -> None:
    """A run under `chrt --idle` stays in the background."""
    assert policies(os.SCHED_IDLE) == (os.SCHED_IDLE, os.SCHED_IDLE)
