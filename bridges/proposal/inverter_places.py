"""The buses of a section at which inverters can stand."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from itertools import accumulate

from gridpeers.plant.equipment import Feeder
from gridpeers.plant.equipment.connectivity import Connectivity
from gridpeers.plant.equipment.imported_equipment import is_behind
from gridpeers.plant.tables.feeder_columns import RATED_CURRENT, power_of


def three_phase(feeder: Feeder) -> list[str]:
    """Return the buses that have phases A, B and C, unless some of them are de-energised and others not."""
    graph = Connectivity(feeder)
    fed = {node for part in graph.fed(graph.closed_at_start(), ())[0] for node in part}
    rows = [bus for bus in feeder.buses if set("ABC") <= set(bus.phases)]
    return [bus.name for bus in rows if len({(bus.name, phase) in fed for phase in "ABC"}) == 1]


def possible_places(
    feeder: Feeder, known: Collection[str], section: Collection[str], rating: float, count: int
) -> list[str]:
    """Return the buses of a section, out of those with three phases, at which inverters of this rating (W) can stand.

    They are of the highest voltage that has as many as `count`, else of the most frequent one: behind a customer's
    transformer an inverter that carries its neighbours, too, raises the voltage beyond all bounds.
    """
    within = set(section).intersection(known)
    rows = [bus for bus in feeder.buses if bus.name in within]
    rows = [bus for bus in rows if not is_behind(bus.name)] or rows
    rows = [bus for bus in rows if rating <= most_rated(bus.V_nom)] or rows
    if not rows:
        return []
    ends = {bus for switch in feeder.switches for bus in (switch.from_bus, switch.to_bus)}
    rows = [bus for bus in rows if bus.name not in ends] or rows
    number = Counter(round(bus.V_nom) for bus in rows)
    enough = [V for V, many in number.items() if many >= count]
    chosen = max(enough) if enough else max(number, key=lambda V: number[V])
    return [bus.name for bus in rows if round(bus.V_nom) == chosen]


def spread(along: Sequence[str], places: Collection[str], count: int, load: Mapping[str, float]) -> list[str]:
    """Return so many places, if there are, with equal parts of the load (W, by bus) around them, along a section."""
    until = list(accumulate((load[bus] for bus in along), initial=0.0))[1:]
    if not until[-1] > 0.0:
        until = [float(k) for k, _ in enumerate(along, start=1)]
    there = [(bus, upto) for bus, upto in zip(along, until, strict=True) if bus in places]
    count = min(count, len(there))
    found: list[str] = []
    at = 0
    for k in range(count):
        middle = (k + 0.5) / count * until[-1]
        last = len(there) - (count - k)  # one is left for each of the others
        while at < last and there[at][1] < middle:
            at += 1
        found.append(there[at][0])
        at += 1
    return found


def most_rated(V_nom: float) -> float:
    """Return the largest plausible rating (W) of an inverter at this voltage (V, line-to-neutral)."""
    return 1e3 * power_of("an inverter", V_nom, RATED_CURRENT, 3).high
