"""A load whose law jumps at a limit of its voltage is reported when its voltage crosses that limit."""

import numpy as np
import pytest
from msgspec.structs import replace

from gridpeers.plant.equipment.imported_equipment import LoadPart
from gridpeers.plant.feeder import Plant
from gridpeers.plant.feeder.limit_events import PAUSE, LoadLimits
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings, SwitchEvent
from gridpeers.plant.tables import read_feeder
from tests.unit.plant.networks import feeder, three_phase_bus

V_NOM = 2400.0


def limits(exponents: tuple[float, float], edge: float = 0.0) -> LoadLimits:
    """Return the limits of a feeder with one load of this law, 3 kW and 4 kvar, at nominal voltage."""
    part = LoadPart(
        name="load.l",
        bus="b",
        ends=("A", ""),
        S=3e3 + 4e3j,
        V_nom=V_NOM,
        exponents=exponents,
        V_low=0.5,
        V_min=0.95,
        V_max=1.05,
        edge=edge,
    )
    network = Network(feeder(buses=(three_phase_bus("b", V_NOM),), load_parts=(part,)))
    return LoadLimits(network, np.array([V_NOM + 0j]))


def texts(watch: LoadLimits, *voltages: float, period: float = 1.0) -> list[str]:
    """Return the texts of the events at these voltages (pu), one after another at this distance (s)."""
    V = [np.array([pu * V_NOM * 1j]) for pu in voltages]
    return [event.text for k, now in enumerate(V) for event in watch.report(k * period, now)]


def test_both_limits_are_reported_in_both_directions() -> None:
    """A load of model 4 takes more below V_min than above it, and less above V_max than below it."""
    found = texts(limits((1.0, 2.0)), 0.96, 0.94, 0.96, 1.06, 1.04)

    assert found == [
        "voltage of load.l falls below V_min, where the law of such a load jumps: 9% more apparent power at once",
        "voltage of load.l rises above V_min, where the law of such a load jumps: 8% less apparent power at once",
        "voltage of load.l rises above V_max, where the law of such a load jumps: 8% less apparent power at once",
        "voltage of load.l falls below V_max, where the law of such a load jumps: 8% more apparent power at once",
    ]


@pytest.mark.parametrize(("exponents", "edge"), [((0.0, 0.0), 0.0), ((1.0, 1.0), 1.0)])
def test_a_law_without_a_jump_is_not_reported(exponents: tuple[float, float], edge: float) -> None:
    """Constant power and constant current go on without a jump at the limits."""
    assert texts(limits(exponents, edge), 0.9, 1.0, 1.1, 1.0) == []


def test_an_oscillation_across_a_limit_is_one_event() -> None:
    """Crossings that follow each other within the pause are one spell; a dead load stays where it was."""
    assert len(texts(limits((1.0, 2.0)), *(0.94, 0.96) * 20, period=0.9 * PAUSE)) == 1
    assert texts(limits((1.0, 2.0)), 1.0, 0.0, 1.0) == []


def test_a_run_tells_which_loads_jumped() -> None:
    """When islanding lowers the voltages, the plant reports the loads that cross V_min, and none if none jumps."""

    def crossings(exponents: tuple[float, float]) -> list[str]:
        tables = read_feeder("ieee34")
        parts = tuple(replace(part, exponents=exponents, edge=0.0, V_min=0.98) for part in tables.load_parts)
        opening = SwitchEvent(t=0.02, switch="sw0", action="open")
        plant = Plant(
            Network(replace(tables, load_parts=parts)), PlantSettings(events=(opening,), P_set0=0.58), 0.02, 0.02
        )
        for _ in range(10):
            plant.advance()
        return [event.text for event in plant.take_events() if "V_min" in event.text]

    assert crossings((0.0, 0.0)) == []
    assert any("falls below V_min" in text for text in crossings((1.0, 2.0)))
