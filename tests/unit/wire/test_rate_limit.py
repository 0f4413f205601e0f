"""Lines that come again and again: the first are said, then one in a while, and all are counted."""

from __future__ import annotations

import logging
import re

import pytest

from gridpeers.wire.driver.log_limit import limit_log
from gridpeers.wire.messages import PlantEvent, Telemetry
from gridpeers.wire.rate_limit import RateLimit
from tests.unit.plant.realtime.realtime_lab import running


def counted(lines: list[str]) -> int:
    """Lines that were said and those that they tell of."""
    left = sum(int(found[1]) for line in lines if (found := re.search(r"(\d+) more of this kind", line)))
    return left + sum(not line[0].isdigit() for line in lines)


def test_a_flood_is_thinned_out_and_every_line_is_counted() -> None:
    """Kinds do not get in each other's way, however many there are."""
    limit = RateLimit(burst=3, interval=10.0)
    said = [line for i in range(1000) if (line := limit.admit(f"late by {i}.5 ms", now=0.1 * i))]
    other = limit.admit("inv1 joined", now=100.0)
    many = [line for i in range(5000) if (line := limit.admit("x" * (i + 1), now=100.0))]

    assert 3 + 9 <= len(said) <= 3 + 10
    assert counted([*said, *limit.left_out()]) >= 1000
    assert other == "inv1 joined"
    assert len(many) < 250


def test_a_plant_that_is_ever_late_does_not_drown_its_own_log_and_record() -> None:
    """2,626 lines of one run once: now a few, and at the end how many there were."""
    lab = running(end=None)
    lab.step(2000, delay=0.5)
    lab.side.close("enough", lab.now)
    events: list[PlantEvent] = [event for message in lab.take(Telemetry) for event in message.events]
    late = [event.text for event in events if event.text.startswith("fell ")]
    lab.do()

    assert 5 <= len(late) <= 5 + 2000 * 0.52 / 10.0 + 2
    assert sum("more of this kind" in line for line in late) >= 2


def test_a_log_leaves_out_what_repeats_itself(caplog: pytest.LogCaptureFixture) -> None:
    """Whoever writes to it; a second limit on the same log changes nothing."""
    log = logging.getLogger("test_rate_limit")
    limit = limit_log(log)
    assert limit_log(log) is limit
    with caplog.at_level(logging.INFO, "test_rate_limit"):
        for i in range(100):
            log.info("woken %.2f s late", 0.1 * i)
    lines = [record.getMessage() for record in caplog.records]

    assert len(lines) == 20
    assert counted([*lines, *limit.left_out()]) == 100
