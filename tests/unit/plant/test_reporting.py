from __future__ import annotations

import math
from typing import Any

import pytest

from gridpeers.plant.plant_interface import Reading
from gridpeers.plant.telemetry_reporter import Reporter, measurement_of
from gridpeers.wire.codec import RejectedError, decode, encode
from gridpeers.wire.messages import Measurement, PlantEvent
from tests.toy.toy_configs import toy_configs
from tests.toy.toy_plant import ToyPlant

CALM = Reading(5e4, 1e3, 277.0, 60.0, 5e4, 277.0, False, "inv1")


def measured(**changes: Any) -> Measurement:
    """Measurement that an agent receives of a reading."""
    reading = CALM._replace(**changes)
    message = decode(encode(measurement_of("inv1", reading, epoch=1, tick=0, t=0.0)))
    assert isinstance(message, Measurement)
    return message


def test_a_sensor_shows_the_end_of_its_scale_and_never_more() -> None:
    """A plant that swings beyond all measure still grants its ticks: whatever it reads, its agents take it."""
    wild = measured(f=1e6, P=-1e15, Q=1e15, V=1e9, P_set=1e300, V_set=-5.0)

    assert (wild.f, wild.P, wild.Q, wild.V, wild.P_set, wild.V_set) == (2000.0, -1e11, 1e11, 1e6, 1e11, 0.0)
    assert measured() == measured(f=60.0)
    assert (measured().f, measured().P) == (60.0, 5e4)


def test_a_reading_that_is_no_number_is_not_made_one() -> None:
    """It goes out as it is, and the agent refuses it: it has no measurement then."""
    with pytest.raises(RejectedError) as refused:
        measured(f=math.nan)
    assert refused.value.kind == "not finite"


def test_texts_go_out_printable() -> None:
    """The text of an error may have line ends in it, and a table may have anything; a recorder refuses such texts."""
    plant = ToyPlant(toy_configs(2)[0])
    reporter = Reporter(1, plant)
    reporter.note(PlantEvent(t=0.0, kind="warning", subject="a\tb", text="two\nlines"))
    (message,) = reporter.report(0.0, final=True, outcome="no\nsolution" + "!" * 5000, reproducible=False)
    told = decode(encode(message))

    assert told == message
    assert message.events[0].text == "two\\x0alines"
    assert message.outcome.startswith("no\\x0asolution")
