"""Where the messages of a record are looked for."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from gridpeers.scenarios.record.message_index import MessageIndex
from gridpeers.scenarios.record.record_file import RecordFile


def index_of(clock: str, speed: float, T_c: float = 0.02) -> MessageIndex:
    """Of a file with a part for each second of a minute."""
    info: Any = SimpleNamespace(clock=clock, T_c=T_c, plant=SimpleNamespace(speed=speed))
    spans = [(float(t), float(t + 1)) for t in range(60)]
    return MessageIndex(cast(RecordFile, SimpleNamespace(info=info, spans=spans)))


@pytest.mark.parametrize(("clock", "speed", "last"), [("simulated", 40.0, 12), ("wall", 1.0, 12), ("wall", 10.0, 30)])
def test_what_comes_late_by_the_clock_is_looked_for_at_the_speed_of_the_run(
    clock: str, speed: float, last: int
) -> None:
    """A journal comes up to two seconds late by the clock, which are twenty of run time at ten times real time."""
    assert index_of(clock, speed).near(10.0, 10.0) == range(9, last)
