"""Random schedules of switchings at loads from 0.8 to 2 times: whatever they do to the grid, the plant goes on."""

from __future__ import annotations

import random
from typing import Literal

import numpy as np
import pytest
from msgspec.structs import replace

from gridpeers.plant.feeder import Plant
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import Method, PlantSettings, Protection, SwitchEvent
from gridpeers.plant.tables import read_feeder

T_C, H, END = 0.02, 0.002, 5.0
SWITCHES = ("13-152", "60-160", "sw1_2", "sw2_3")
BAND = {"off": (25.0, 95.0), "III": (54.0, 63.0)}
"""Frequencies (Hz) of who delivers. Without protection a GFM can have 60 and the bound of its limiters, 200 rad/s, and
a bit for the droop; with it, what lies 0.16 s beyond 56.5 and 62 Hz."""

NO_SOLUTION = ("overload", "out of phase", "voltage collapse")
PROTECTION = ("voltage", "frequency")


def schedule(draw: random.Random) -> tuple[SwitchEvent, ...]:
    """Six to twelve switchings; the first islands the feeder, else nothing much happens."""
    first = SwitchEvent(t=0.1, switch="13-152", action="open")
    rest = [
        SwitchEvent(
            t=round(draw.randrange(round(0.2 / H), round(END / H)) * H, 9),
            switch=draw.choice(SWITCHES),
            action=draw.choice(("open", "close")),
            synchronised=draw.random() < 0.2,
        )
        for _ in range(draw.randint(5, 11))
    ]
    return first, *sorted(rest, key=lambda event: event.t)


@pytest.mark.parametrize(
    ("category", "seed", "method"),
    [
        *(("off", i, "first-order") for i in range(20)),
        *(("III", i, "first-order") for i in range(10)),
        *((category, i, "second-order") for i in range(2) for category in ("off", "III")),
    ],
)
def test_no_schedule_of_switchings_ends_the_plant(category: Literal["off", "III"], seed: int, method: Method) -> None:
    """Every row is finite; who delivers has a frequency within bounds, who does not has no power; trips are told."""
    draw = random.Random(f"switchings {seed}")
    factor = draw.uniform(0.8, 2.0)
    feeder = read_feeder("microgrid123")
    loads = tuple(replace(load, S=tuple(factor * S for S in load.S)) for load in feeder.loads)
    settings = PlantSettings(events=schedule(draw), h=H, method=method, protection=Protection(category=category))
    plant = Plant(Network(replace(feeder, loads=loads)), settings, T_C, T_C)
    low, high = BAND[category]
    causes = NO_SOLUTION if category == "off" else (*NO_SOLUTION, *PROTECTION)

    events, off = [], set[str]()
    for _ in range(round(END / T_C)):
        plant.advance()
        new = plant.take_events()
        events += new
        off.update(
            name for event in new if event.kind in ("trip", "dead") for name in plant.inverters if name in event.text
        )
        for name, reading in plant.measure().items():
            assert np.isfinite([reading.P, reading.Q, reading.V, reading.f]).all()
            if reading.P or reading.Q:
                assert low < reading.f < high
            else:
                assert name in off

    assert np.isfinite(np.array(plant.take_rows())).all()
    for trip in (event for event in events if event.kind == "trip"):
        assert any(cause in trip.text for cause in causes)
