"""The feeders that many tests look at; a network is never written to, so one serves all."""

from __future__ import annotations

import pytest

from gridpeers.plant.network import Network
from gridpeers.plant.tables import read_feeder


@pytest.fixture(scope="session")
def network() -> Network:
    return Network(read_feeder("microgrid123"))


@pytest.fixture(scope="session")
def standard() -> Network:
    return Network(read_feeder("standard123"))
