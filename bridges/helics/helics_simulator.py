"""HELICS as the plant of a run: table `[plant.helics]`, and the start."""

from __future__ import annotations

import re
from typing import Annotated

import msgspec

from gridpeers.plant.equipment import Tables
from gridpeers.plant.plant_config import PlantConfig, PlantSettings
from gridpeers.plant.plant_interface import PlantLike
from gridpeers.plant.simulators import Simulator
from gridpeers.wire.messages import NAME
from gridpeers.wire.schema.table_schema import Example, Plausible, Problem, Unit

BROKER = "tcp://127.0.0.1:23404"  # address of a HELICS broker that was started without options on this machine
_ADDRESS = re.compile(r"(tcp://)?([A-Za-z0-9_.-]+)(:(?P<port>\d{1,5}))?")


class HelicsSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The federate of a run, and its broker."""

    broker: Annotated[str, Example('"tcp://10.0.0.5:23404"')] = BROKER
    """Address of the broker, of core type ZMQ."""
    name: str = "gridpeers"
    """Name of the federate, unique in its federation."""
    prefix: str = "grid"
    """First part of every topic: "grid" gives grid/inv1/P."""
    wait: Annotated[float, Unit("s"), Plausible("a wait for federates", 0.1, 3600.0)] = 180.0
    """Longest wait (s of real time) for the other federates to begin."""

    def relations(self) -> list[Problem]:
        """Return the problems of the values.

        >>> HelicsSettings(broker="tcp://127.0.0.1:99999").relations()[0].text
        'must be like tcp://127.0.0.1:23404, got "tcp://127.0.0.1:99999"'
        """
        found = []
        match = _ADDRESS.fullmatch(self.broker)
        if match is None or not 0 < int(match["port"] or 1) < 65536:
            found.append(Problem("broker", f'must be like {BROKER}, got "{self.broker}"'))
        for key in ("name", "prefix"):
            value = getattr(self, key)
            if not re.fullmatch(NAME, value):
                found.append(Problem(key, f'must be up to 64 letters, digits, "_", "-" or ".", got "{value}"'))
        return found


def settings_of(settings: PlantSettings) -> HelicsSettings:
    return msgspec.convert(settings.simulators.get("helics", {}), HelicsSettings)


class HelicsSimulator(Simulator):
    """A HELICS federation as the plant."""

    package = "helics"
    words = "a HELICS federate"
    elsewhere = True
    table = HelicsSettings

    def start(self, config: PlantConfig, feeder: Tables) -> PlantLike:
        from gridpeers.bridges.helics.helics_plant import HelicsPlant  # the check of a scenario does not need it

        return HelicsPlant(config, feeder)

    def starting(self, table: HelicsSettings | None) -> str:
        return f"still starting: waiting for the HELICS federation at {table.broker if table else BROKER} ..."


HELICS = HelicsSimulator()


def endpoint(broker: str) -> tuple[str, int]:
    """Return host and port of a broker's address.

    >>> endpoint("tcp://10.0.0.5:24000"), endpoint("localhost")
    (('10.0.0.5', 24000), ('127.0.0.1', 23404))
    """
    match = _ADDRESS.fullmatch(broker)
    assert match is not None, broker
    host = "127.0.0.1" if match[2] == "localhost" else match[2]  # HELICS listens at numbers
    return host, int(match["port"] or 23404)
