"""De-energised buses of a feeder: those without a path to the substation or to an inverter on the network. Pure."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping

from gridpeers.scenarios.live.feeder_map import FeederMap


def dead_buses(feeder: FeederMap, switches: Mapping[str, bool], on: Collection[str]) -> tuple[int, ...]:
    """Return the numbers of de-energised buses; `on` has the inverters on the network."""
    beside: dict[int, list[int]] = defaultdict(list)
    closed = (switch for switch in feeder.switches if switches.get(switch.name, switch.closed))
    for a, b in (*((a, b) for a, b, _ in feeder.branches), *((switch.a, switch.b) for switch in closed)):
        beside[a].append(b)
        beside[b].append(a)
    reached = {inverter.bus for inverter in feeder.inverters if inverter.name in on} | {feeder.source} - {-1}
    front = list(reached)
    while front:
        new = set(beside[front.pop()]) - reached
        reached |= new
        front += new
    return tuple(number for number in range(len(feeder.buses)) if number not in reached)
