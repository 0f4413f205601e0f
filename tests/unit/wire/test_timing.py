"""Deadlines of a tick, the message when one passes, and repeated lines of a log."""

from __future__ import annotations

import logging
import re

import pytest

from gridpeers.wire.driver.drive import limit_log
from gridpeers.wire.timing import STOOD_STILL, RateLimit, TickBarrier


def barrier() -> TickBarrier:
    made = TickBarrier("plant", 10.0)
    made.wait_for({"inv1": "State(4)", "inv2": "State(4)"}, now=5.0)
    return made


def test_the_complaint_names_what_and_whom_and_the_last_sign_of_life() -> None:
    """It also names a sender that was never heard."""
    made = barrier()
    made.last_heard["inv1"] = 3, 2.0

    assert made.complaint(made.missing_messages(), 15.0) == (
        "plant: no State(4) from inv1 within 10 s; last heard of inv1: tick 3, 13.0 s ago. "
        "no State(4) from inv2 within 10 s; nothing was ever heard from inv2"
    )


def test_who_looks_long_after_the_deadline_has_stood_still_itself() -> None:
    """A deadline passes at its time or a little later. If the process looks much later, the deadline starts again."""
    made = barrier()
    made.renew(0.0)
    due = made.deadline or 0.0

    assert [made.is_over(due - 0.1), made.is_over(due), made.is_over(due + STOOD_STILL)] == [False, True, True]
    assert not made.is_over(due + 600.0)
    assert made.deadline == 2.0 * due + 600.0
    assert made.is_over(made.deadline)
    made.rest()
    assert not made.is_over(1e9)


def counted(lines: list[str]) -> int:
    left = sum(int(found[1]) for line in lines if (found := re.search(r"(\d+) more of this kind", line)))
    return left + sum(not line[0].isdigit() for line in lines)


def test_a_flood_is_thinned_out_and_every_line_is_counted() -> None:
    """One kind does not hide another, whatever their number."""
    limit = RateLimit(burst=3, interval=10.0)
    said = [line for i in range(1000) if (line := limit.admit(f"late by {i}.5 ms", now=0.1 * i))]
    other = limit.admit("inv1 joined", now=100.0)
    many = [line for i in range(5000) if (line := limit.admit("x" * (i + 1), now=100.0))]

    assert 3 + 9 <= len(said) <= 3 + 10
    assert counted([*said, *limit.left_out()]) >= 1000
    assert other == "inv1 joined"
    assert len(many) < 250


def test_a_log_leaves_out_what_repeats_itself(caplog: pytest.LogCaptureFixture) -> None:
    """The limit holds for every writer. A second limit on the same log changes nothing."""
    log = logging.getLogger("test_rate_limit")
    limit = limit_log(log)
    assert limit_log(log) is limit
    with caplog.at_level(logging.INFO, "test_rate_limit"):
        for i in range(100):
            log.info("woken %.2f s late", 0.1 * i)
    lines = [record.getMessage() for record in caplog.records]

    assert len(lines) == 20
    assert counted([*lines, *limit.left_out()]) == 100
