"""Names of an imported feeder that its tables can hold. Pure."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

import msgspec

from gridpeers.plant.equipment import Feeder
from gridpeers.plant.equipment.imported_equipment import BEHIND, bus_behind
from gridpeers.wire.wording import first_of

SHOWN = 8
"""How many buses the note names."""


def with_plain_names(feeder: Feeder, added: Mapping[str, str]) -> Feeder:
    """Return a feeder in which "_" stands for what a name cannot have; its notes name the buses.

    A bus has no blanks and no "~", and no name has characters that cannot be printed. Where two buses would have the
    same name, the later one ends with "_2".

    Parameters
    ----------
    feeder
        As the other program has it.
    added
        Buses that the import has added, and the bus before each (`bus_behind`).
    """
    before = dict.fromkeys([*(bus.name for bus in feeder.buses if bus.name not in added), *added.values()])
    buses = _distinct(before, _plain_bus)
    renamed = [f'"{old}" is {new}' for old, new in buses.items() if old != new]
    for name, like in added.items():
        buses[name] = bus_behind(buses[like], _plain_bus(name.removeprefix(bus_behind(like, ""))))
    elements = _distinct([*(row.name for row in feeder.elements), *(part.name for part in feeder.load_parts)], _plain)
    aliases = _distinct([row.alias for row in feeder.switches], _plain)
    if not renamed and all(old == new for names in (buses, elements, aliases) for old, new in names.items()):
        return feeder
    replace = msgspec.structs.replace
    note = f"buses have other names here, without blanks: {first_of(renamed, SHOWN)}"
    ends = [(buses[row.from_bus], buses[row.to_bus]) for row in feeder.switches]
    return replace(
        feeder,
        buses=tuple(replace(bus, name=buses[bus.name]) for bus in feeder.buses),
        elements=tuple(
            replace(row, name=elements[row.name], nodes=tuple((buses[bus], letter) for bus, letter in row.nodes))
            for row in feeder.elements
        ),
        load_parts=tuple(replace(part, name=elements[part.name], bus=buses[part.bus]) for part in feeder.load_parts),
        switches=tuple(
            replace(row, name=f"{one}-{other}", alias=aliases[row.alias], from_bus=one, to_bus=other)
            for row, (one, other) in zip(feeder.switches, ends, strict=True)
        ),
        source=feeder.source and replace(feeder.source, bus=buses[feeder.source.bus]),
        notes=(*feeder.notes, *([note] if renamed else [])),
        places={
            f"bus {buses[name.removeprefix('bus ')]}"
            if name.removeprefix("bus ") in buses
            else elements.get(name, name): place
            for name, place in feeder.places.items()
        },
    )


def _distinct(names: Collection[str], plain: Callable[[str], str]) -> dict[str, str]:
    """Return a plain name for each name, the same for no two."""
    found = {name: name for name in names if plain(name) == name}
    taken = set(found)
    for name in names:
        if name not in found:
            new, number = plain(name), 2
            while new in taken:
                new, number = f"{plain(name)}_{number}", number + 1
            taken.add(new)
            found[name] = new
    return found


def _plain(name: str) -> str:
    return "".join(letter if letter.isprintable() else "_" for letter in name)


def _plain_bus(name: str) -> str:
    return "".join("_" if letter.isspace() or letter == BEHIND else letter for letter in _plain(name))
