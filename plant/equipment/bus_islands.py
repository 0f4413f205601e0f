"""Switches by name, and the sets of buses that closed switches leave connected: no admittances needed."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator

from gridpeers.plant.equipment.equipment import Feeder
from gridpeers.wire.wording import suggestion

SwitchOperations = tuple[Iterable[str], Iterable[str]]
"""Switches that open, and switches that close, by any of their names."""


def switch_names(feeder: Feeder) -> dict[str, str]:
    """Return the name of each switch in the tables, by each of its names."""
    return {name: switch.name for switch in feeder.switches for name in switch.names}


def switch_name(feeder: Feeder, text: str) -> str:
    """Resolve a switch's name in either order of its buses, or its alias ("sw1_2"), to its name in the tables.

    Raises
    ------
    ValueError
        If no switch has this name.
    """
    known = switch_names(feeder)
    if text not in known:
        shown = [switch.alias or switch.name for switch in feeder.switches]
        hint = suggestion(text, shown, "switches", also=known)
        raise ValueError(f'switch "{text}": no such switch in feeder "{feeder.name}"; {hint}')
    return known[text]


def bus_islands(feeder: Feeder, closed: Collection[str]) -> tuple[frozenset[str], ...]:
    """Return the sets of buses joined by branches and these closed switches, in the order of their first buses.

    Parameters
    ----------
    feeder
        Its tables.
    closed
        Names of the closed switches, as in the tables.
    """
    above = {bus.name: bus.name for bus in feeder.buses}

    def root(bus: str) -> str:
        while above[bus] != bus:
            above[bus] = above[above[bus]]
            bus = above[bus]
        return bus

    for one, other, _ in feeder.branches():
        above[root(one)] = root(other)
    for switch in feeder.switches:
        if switch.name in closed:
            above[root(switch.from_bus)] = root(switch.to_bus)
    members: dict[str, list[str]] = {}
    for bus in above:
        members.setdefault(root(bus), []).append(bus)
    return tuple(frozenset(buses) for buses in members.values())


def islands_after(feeder: Feeder, operations: Iterable[SwitchOperations]) -> Iterator[tuple[frozenset[str], ...]]:
    """Yield the islands after each of some operations of switches, from those that are closed at the start."""
    closed = {switch.name for switch in feeder.switches if switch.closed}
    for opened, shut in operations:
        closed.difference_update(switch_name(feeder, name) for name in opened)
        closed.update(switch_name(feeder, name) for name in shut)
        yield bus_islands(feeder, closed)
