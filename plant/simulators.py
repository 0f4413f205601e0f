"""The port to simulators of others, which take the place of our plant: found by name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import msgspec

from gridpeers.wire.plugins.registry import Registry

if TYPE_CHECKING:
    from gridpeers.plant.equipment import Tables
    from gridpeers.plant.plant_config import PlantConfig
    from gridpeers.plant.plant_interface import PlantLike

OURS = "gridpeers"


class Simulator:
    """What `plant.simulator` of a scenario names: an object of a class derived from this one, by an entry point."""

    package: ClassVar[str] = ""  # package that it needs; the extra of gridpeers has the same name
    words: ClassVar[str] = ""  # what needs the package and simulates the plant, e.g. "a HELICS federate"
    elsewhere: ClassVar[bool] = False
    """Whether the plant runs elsewhere: we do not know its network and its operating point, and it runs once."""
    table: ClassVar[type[msgspec.Struct] | None] = None
    """Its own table of a scenario, `[plant.NAME]`; a method `relations` returns what is wrong with the values."""

    def start(self, config: PlantConfig, feeder: Tables) -> PlantLike:
        """Start the plant on a feeder with the scenario's changes; RuntimeError says why it cannot start."""
        raise NotImplementedError

    def check(self, scenario: Any, feeder: Tables, problems: Any) -> None:
        """Note the requests of a scenario that this simulator cannot serve.

        Types: `gridpeers.scenarios.schema.scenario_model.ScenarioModel`, and `Problems` beside it.
        """

    def starting(self, table: Any) -> str:
        """Return a message to show during the start; `table`: the simulator's own table of the scenario, or None."""
        return ""


SIMULATORS: Registry[Simulator] = Registry(
    "simulator",
    "simulators",
    lambda it: "" if isinstance(it, Simulator) else "it is no object of a class derived from Simulator",
    own={OURS: f"{__name__}:_ours"},
)

_ours = Simulator()


def tables() -> dict[str, type[msgspec.Struct]]:
    found = {name: SIMULATORS.resolve(name).table for name in SIMULATORS.names}
    return {name: table for name, table in found.items() if table is not None}
