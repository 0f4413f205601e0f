"""Events after which inverters have less power available: what they mean, and every problem that can be made."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from gridpeers.plant.feeder import Plant
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings, PowerLimit, SwitchEvent
from gridpeers.plant.tables import read_feeder
from gridpeers.scenarios.catalogue_files import CATALOGUE
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.configs import limits_of
from gridpeers.scenarios.schema.scenario_writing import to_toml
from tests.scenario_files import problems, written

CLOUDS = (CATALOGUE / "intermittency.toml").read_text(encoding="utf-8")


def test_a_case_has_its_own_available_power(tmp_path: Path) -> None:
    """A case's value for an inverter replaces the event's; the copy of a run has the same."""
    text = CLOUDS.replace("clouds = { inv2 = 275, inv5 = 275, inv8 = 275 }", "clouds = { inv2 = 275 }")
    scenario, _ = load_scenario(written(tmp_path, text))

    assert [limit.P_max for limit in limits_of(scenario, "275kW")] == [275e3, 350e3, 350e3]
    assert [limit.P_max for limit in limits_of(scenario, "350kW")] == [350e3, 350e3, 350e3]

    assert load_scenario(written(tmp_path, to_toml(scenario, {})))[0] == scenario


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ("{ inv5 = -1 }", "inv5 can have from 0 to 350 kW available, got -1 kW"),
    ],
)
def test_a_limit_that_cannot_be_is_told_with_what_would_be_right(tmp_path: Path, wrong: str, told: str) -> None:
    """File, line, inverter, value and unit, and the range that makes sense."""
    text = CLOUDS.replace("{ inv2 = 350, inv5 = 350, inv8 = 350 }", wrong, 1)
    found = problems(tmp_path, text)

    number = next(number for number, line in enumerate(text.splitlines(), 1) if wrong in line)
    assert any(line.startswith(f"mine.toml:{number}: event[1].P_max_kW: ") and told in line for line in found)


def test_a_case_that_names_no_event_is_told(tmp_path: Path) -> None:
    """A label that is no event's is a slip, and the problem says which there are."""
    found = problems(tmp_path, CLOUDS.replace("{ clouds = { inv2 = 275", "{ cluods = { inv2 = 275"))

    assert any('no event "cluods"; did you mean "clouds"' in line for line in found)


def test_a_limited_inverter_gives_no_more_than_it_has_and_all_again_later() -> None:
    """P falls to the limit within its filter's time, the grid takes the rest, and P is back when the limit is."""
    settings = PlantSettings(
        limits=(PowerLimit(t=0.05, inverter="inv2", P_max=150e3), PowerLimit(t=0.6, inverter="inv2", P_max=350e3)),
    )
    plant = Plant(Network(read_feeder("microgrid123")), settings, 0.02, 0.01)
    for _ in range(60):
        plant.advance()
    rows = np.array(plant.take_rows())
    t, P = rows[:, 0], rows[:, 1 + 6 * plant.inverters.index("inv2") + 1]

    assert P[t < 0.05] == pytest.approx(0.647 * 350e3, rel=1e-3)
    assert P[(t > 0.5) & (t < 0.6)] == pytest.approx(150e3, rel=1e-2)
    assert P[-1] == pytest.approx(0.647 * 350e3, rel=1e-2)
    assert [(event.t, event.kind, event.subject) for event in plant.take_events()] == [
        (0.05, "limit", "inv2"),
        (0.6, "limit", "inv2"),
    ]


def test_only_a_grid_following_inverter_can_be_limited() -> None:
    """The plant refuses it for a GFM, whose power is what the network takes, and says so."""
    settings = PlantSettings(
        events=(SwitchEvent(t=0.01, switch="13-152", action="open"),),
        limits=(PowerLimit(t=0.0, inverter="inv1", P_max=150e3),),
    )
    plant = Plant(Network(read_feeder("microgrid123")), settings, 0.02, 0.01)

    with pytest.raises(ValueError, match="inv1 is grid-forming"):
        plant.advance()


def test_the_catalogues_cases_are_those_of_table_III() -> None:
    """350, 275, 250, 225 and 200 kW, and 175 kW beyond what the others can take over. Section 4."""
    cases = tomllib.loads(CLOUDS)["case"]

    assert list(cases) == ["350kW", "275kW", "250kW", "225kW", "200kW", "175kW"]
