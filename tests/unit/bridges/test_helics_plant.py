"""The plant that a HELICS federate simulates, on a federation that a test makes up."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, ClassVar

import pytest

from gridpeers.bridges.helics import helics_plant
from gridpeers.bridges.helics.federate import HelicsError
from gridpeers.bridges.helics.helics_plant import HelicsPlant
from gridpeers.plant.plant_config import PlantConfig, PlantSettings
from gridpeers.plant.tables import read_feeder

VALUES = {"f": 60.0, "P": 1e5, "Q": 0.0, "V": 277.0}


class _MadeUp:
    """A federation with one other federate."""

    missing: ClassVar[list[str]] = []
    came: ClassVar[dict[str, Any]] = {}

    def __init__(self, *_: object) -> None:
        self.aborted = ""

    def begin(self, *_: object) -> Mapping[str, list[str]]:
        return {"others": ["strange"], "missing": self.missing}

    def step(self, *_: object) -> Mapping[str, Any]:
        return self.came

    def abort(self, reason: str) -> None:
        self.aborted = reason


@pytest.mark.parametrize(("missing", "other", "said"), [
    (
        ["grid/inv3/V"],
        {},
        "HELICS: nobody publishes grid/inv3/V (in the federation: strange); publish these topics",
    ),
    ([], {"grid/inv3/V": None}, "HELICS, t = 0 s: no value yet of grid/inv3/V; publish all at t = 0 or before"),
    ([], {"grid/inv1/f": -1e49}, "HELICS, t = 0 s: grid/inv1/f is not a finite number; correct its publisher"),
    ([], {"grid/inv1/island": "a b"}, "grid/inv1/island must be the name of an inverter, grid or off, got 'a b'"),
])  # fmt: skip
def test_topics_of_others_that_cannot_be_used_end_the_run_with_one_line(
    missing: list[str], other: dict[str, Any], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A double that is none, as of a text, comes as -1e49."""
    feeder = read_feeder("microgrid123")
    sensors = {f"grid/{row.name}/{key}": value for row in feeder.inverters for key, value in VALUES.items()}
    came = {key: value for key, value in (sensors | other).items() if value is not None}
    monkeypatch.setattr(helics_plant, "HelicsFederate", type("Made", (_MadeUp,), {"missing": missing, "came": came}))
    config = PlantConfig(
        run="toy",
        settings=PlantSettings(simulator="helics"),
        agents=(),
        T_c=0.02,
        end=0.06,
        record_step=0.02,
        deadline=30.0,
        listen=(),
    )

    with pytest.raises(HelicsError, match=re.escape(said)):
        HelicsPlant(config, feeder)
