"""The switch to island a feeder at, and lines that would make one."""

from __future__ import annotations

from collections import defaultdict

from gridpeers.bridges.proposal.feeder_walk import cut_off_sums, depth_first, neighbours
from gridpeers.bridges.proposal.inverter_groups import GROUP
from gridpeers.bridges.proposal.inverter_places import three_phase
from gridpeers.bridges.proposal.proposal_errors import NoProposalError, NoSwitchError
from gridpeers.plant.equipment import Feeder
from gridpeers.plant.equipment.connectivity import Connectivity

ENOUGH = 0.5
"""Part of the feeder's load that the switch must cut off, to be worth islanding."""
LINES = {"line": "Line", "overhead_line": "overhead_line", "underground_line": "underground_line"}
"""Classes of lines in OpenDSS and GridLAB-D, as a line that is to be a switch is written."""


def islanding_switch(feeder: Feeder) -> tuple[str, str, frozenset[str]]:
    """Return the closed switch that cuts most load off the substation, its far bus, and the buses beyond it."""
    if feeder.source is None:
        raise NoProposalError("the feeder has no substation to island from")
    graph, load = Connectivity(feeder), feeder.load_by_bus()
    if sum(load.values()) <= 0.0:
        raise NoProposalError("the feeder has no load, which inverters are rated by")
    places = set(three_phase(feeder))
    best, head, beyond, most = "", "", frozenset[str](), (False, 0.0, 0)
    for switch in feeder.switches:
        buses = graph.cut_off(switch) if switch.closed else frozenset()
        # a lumped load beside the feeder is no island, however large
        weight = len(buses & places) >= GROUP, sum(load.get(bus, 0.0) for bus in buses), len(buses)
        if weight > most:
            best, beyond, most = switch.alias or switch.name, buses, weight
            head = switch.to_bus if switch.to_bus in buses else switch.from_bus
    large, cut_off, _ = most
    if not large or cut_off < ENOUGH * sum(load.values()):
        lines = heads(feeder, more_than=1.01 * cut_off, small=not large)
        if lines or cut_off <= 0.0:
            raise NoSwitchError(lines)
    return best, head, beyond


def heads(feeder: Feeder, more_than: float, *, small: bool, count: int = 3) -> list[str]:
    """Return three-phase lines that would make switches, the best first.

    They cut off more than so much load (W): half of all load or more as near to the substation as possible, else
    as much as possible. Lines that cut off a lumped load come last, and only with `small`.
    """
    if feeder.source is None:
        return []
    load, near = feeder.load_by_bus(), neighbours(feeder)
    total = sum(load.values())
    where = {bus: place for place, bus in enumerate(depth_first(near, [feeder.source.bus]))}
    number = defaultdict[frozenset[str], int](int)
    for one, other, _ in feeder.branches():
        number[frozenset((one, other))] += 1
    below = cut_off_sums(near, feeder.source.bus, load)
    places = cut_off_sums(near, feeder.source.bus, dict.fromkeys(three_phase(feeder), 1.0))
    found: list[tuple[bool, bool, float, int, str]] = []
    for row in feeder.elements:
        kind, _, name = row.name.partition(".")
        buses = {bus for bus, _ in row.nodes}
        if kind in LINES and len(row.nodes) >= 6 and len(buses) == 2 and number[frozenset(buses)] == 1:
            one, other = sorted(buses, key=lambda bus: where.get(bus, -1))
            weight = below.get((one, other), 0.0)
            if weight > more_than:
                enough = weight >= ENOUGH * total
                nearness = where[one] if enough else -weight
                lumped = places.get((one, other), 0.0) < GROUP
                if small or not lumped:
                    found.append((lumped, not enough, nearness, where[one], f"{LINES[kind]}.{name}"))
    return [name for *_, name in sorted(found)[:count]]
