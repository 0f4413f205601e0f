"""The one-line diagram of a feeder as the plant hands it out: places of buses, branches, switches and inverters."""

from __future__ import annotations

import msgspec

from gridpeers.plant.equipment import Tables
from gridpeers.plant.equipment.named_loads import named_loads
from gridpeers.scenarios.results.plots.places import has_coordinates, places
from gridpeers.wire.codec import decode_foreign


class MapSwitch(msgspec.Struct, frozen=True):
    name: str
    alias: str
    a: int
    b: int
    closed: bool


class MapInverter(msgspec.Struct, frozen=True):
    name: str
    bus: int
    kind: str
    microgrid: str
    spare: bool = False


class MapLoad(msgspec.Struct, frozen=True):
    name: str
    bus: int
    P: float
    """Real power at nominal voltage (W), of the feeder's tables."""
    Q: float
    """Reactive power at nominal voltage (var), of the feeder's tables."""


class FeederMap(msgspec.Struct, frozen=True):
    """A feeder's one-line diagram, and what runs on it."""

    buses: tuple[tuple[str, float, float], ...] = ()
    """Name and place of each bus, in the units of its coordinates."""
    branches: tuple[tuple[int, int, int], ...] = ()
    """Numbers of the two buses of each branch, and its number of phases."""
    switches: tuple[MapSwitch, ...] = ()
    inverters: tuple[MapInverter, ...] = ()
    loads: tuple[MapLoad, ...] = ()
    source: int = -1
    """Number of the substation's bus; -1 if there is none."""
    to_scale: bool = True
    """True if both axes have the same unit; False if the places are those of a tree."""
    scenario: str = ""
    """Name of the running scenario; empty for the diagram of a feeder alone."""
    case: str = ""


def feeder_map(feeder: Tables) -> FeederMap:
    at = places(feeder)
    number = {bus.name: i for i, bus in enumerate(feeder.buses)}
    return FeederMap(
        buses=tuple((bus.name, float(at[bus.name][0]), float(at[bus.name][1])) for bus in feeder.buses),
        branches=tuple((number[a], number[b], phases) for a, b, phases in feeder.branches()),
        switches=tuple(
            MapSwitch(row.name, row.alias, number[row.from_bus], number[row.to_bus], row.closed)
            for row in feeder.switches
        ),
        inverters=tuple(
            MapInverter(row.name, number[row.bus], row.kind, row.microgrid, row.spare)
            for row in (*feeder.inverters, *feeder.spares)
        ),
        loads=tuple(
            MapLoad(load.name, number[load.bus], load.S.real, load.S.imag) for load in named_loads(feeder).values()
        ),
        source=-1 if feeder.source is None else number[feeder.source.bus],
        to_scale=has_coordinates(feeder),
    )


def read_feeder_map(payload: bytes) -> FeederMap | None:
    """Return the map in an answer of the plant; None for other bytes, or if it names an unknown bus."""
    try:
        found = decode_foreign(msgspec.json.Decoder(FeederMap).decode, payload)
    except msgspec.DecodeError:
        return None
    numbers = [
        *(end for a, b, _ in found.branches for end in (a, b)),
        *(end for switch in found.switches for end in (switch.a, switch.b)),
        *(inverter.bus for inverter in found.inverters),
        *(load.bus for load in found.loads),
    ]
    fits = all(0 <= number < len(found.buses) for number in numbers) and -1 <= found.source < len(found.buses)
    return found if fits else None
