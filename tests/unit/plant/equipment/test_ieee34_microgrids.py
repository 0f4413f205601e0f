"""The tables of the feeder ieee34, which comes with gridpeers."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace

from gridpeers.plant.tables import read_feeder


def test_the_tables_are_the_import_of_the_published_feeder_with_our_modifications() -> None:
    """The tables are the engine's present reading of the script, to rounding."""
    pytest.importorskip("dss", reason="the OpenDSS engine is not installed")
    from tests.feeders.ieee34_microgrids import ieee34_microgrids

    made, kept = ieee34_microgrids(), read_feeder("ieee34")

    assert [element.nodes for element in made.elements] == [element.nodes for element in kept.elements]
    for one, other in zip(made.elements, kept.elements, strict=True):
        np.testing.assert_allclose(other.Y, one.Y, rtol=1e-9, atol=1e-12, err_msg=one.name)
    assert kept.switches == made.switches
    assert [replace(row, V_nom=0.0) for row in kept.inverters] == [replace(row, V_nom=0.0) for row in made.inverters]
    assert [(part.name, part.bus, part.ends, part.exponents) for part in kept.load_parts] == [
        (part.name, part.bus, part.ends, part.exponents) for part in made.load_parts
    ]
    assert sum(part.S for part in kept.load_parts) == pytest.approx(1769e3 + 1044e3j)
    assert {bus.zone for bus in kept.buses} == {"rest", "MG1", "MG2", "MG3"}
