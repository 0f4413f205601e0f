"""The number of threads of the linear algebra must not show in a run."""

from __future__ import annotations

import hashlib

from threadpoolctl import threadpool_limits

from gridpeers.plant.feeder import Plant
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings, SwitchEvent
from gridpeers.plant.tables import read_feeder


def digest(threads: int) -> str:
    """Hash of a short run that is islanded on the way."""
    with threadpool_limits(threads):
        events = (SwitchEvent(t=0.1, switch="13-152", action="open"),)
        plant = Plant(Network(read_feeder("microgrid123", "main")), PlantSettings(events=events), 0.02, 0.02)
        for _ in range(20):
            plant.advance()
    return hashlib.sha256(repr(plant.take_rows()).encode()).hexdigest()


def test_the_bytes_do_not_depend_on_the_number_of_threads() -> None:
    """A run on a machine with more cores gives the same rows to the last bit."""
    assert digest(3) == digest(1)
