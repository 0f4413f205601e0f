"""The port to simulators of others: one that a test brings is read, checked, written and started by its name."""

from __future__ import annotations

from typing import Annotated, Any

import msgspec
import pytest

import gridpeers as gp
from gridpeers.plant.build import start_plant
from gridpeers.plant.simulators import SIMULATORS, Simulator
from gridpeers.scenarios.schema.configs import configs
from gridpeers.wire.schema.table_schema import Plausible, Problem, Unit


class Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Its own table, `[plant.made_up]`."""

    step: Annotated[float, Unit("s"), Plausible("a step", 0.001, 1.0)] = 0.01
    """Its step (s)."""
    mesh: str = "coarse"
    """Its mesh."""

    def relations(self) -> list[Problem]:
        """Refuse a fine mesh."""
        return [Problem("mesh", 'must be "coarse"')] if self.mesh != "coarse" else []


class MadeUp(Simulator):
    """A simulator whose plant is what it was asked for."""

    table = Table

    def start(self, config: Any, feeder: Any) -> Any:
        return config.settings.simulators, feeder.name

    def check(self, scenario: Any, feeder: Any, problems: Any) -> None:
        if scenario.events:
            problems.add("event[0]", "the made-up plant has no switches")


@pytest.fixture(autouse=True)
def made_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(SIMULATORS, "_added", {"made_up": MadeUp()})


def scenario(**plant: Any) -> gp.Scenario:
    return gp.Scenario(
        time={"end_s": 0.2}, plant={"simulator": "made_up", **plant}, case={"I": {"secondary": "none", "graph": "none"}}
    )


def test_its_table_goes_from_the_scenario_to_its_start() -> None:
    """It is in the scenario as run, too, every default spelled out."""
    found = scenario(made_up={"step_s": 0.02})

    assert '[plant.made_up]\nstep_s = 0.02\nmesh = "coarse"\n' in found.to_toml()
    assert start_plant(configs(found.spec, found.feeder, "I")[0]) == (
        {"made_up": {"step": 0.02, "mesh": "coarse"}},
        "microgrid123",
    )


@pytest.mark.parametrize(("plant", "said"), [
    ({"made_up": {"mesh": "fine"}}, 'plant.made_up.mesh: must be "coarse"'),
    ({"simulator": "made-up"}, 'plant.simulator: there is no "made-up"; did you mean "made_up"?'),
])  # fmt: skip
def test_what_is_wrong_in_it_is_said_as_of_any_table(plant: dict[str, Any], said: str) -> None:
    """Values, relations, keys, and the simulator's name."""
    with pytest.raises(gp.ScenarioError) as error:
        scenario(**plant)

    assert said in str(error.value)


def test_its_own_checks_are_asked() -> None:
    """What it cannot do is refused before anything starts."""
    with pytest.raises(gp.ScenarioError, match=r"event\[0\]: the made-up plant has no switches"):
        scenario().replace({"event": [{"label": "one", "t_s": 0.1, "open": ["13-152"]}]})
