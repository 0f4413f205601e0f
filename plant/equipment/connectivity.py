"""Which buses and nodes of a feeder are connected, and whether they are fed: no admittances needed."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterable, Iterator
from itertools import chain
from typing import TypeVar

from gridpeers.plant.equipment import PHASES, InverterRow, Line, Regulator, Switch, Tables, Transformer
from gridpeers.wire.wording import suggestion

SwitchOperations = tuple[Iterable[str], Iterable[str]]  # switches that open, and that close, by any of their names


def switch_names(feeder: Tables) -> dict[str, str]:
    return {name: switch.name for switch in feeder.switches for name in switch.names}


def switch_name(feeder: Tables, text: str) -> str:
    """Resolve a switch's name in either order of its buses, or its alias ("sw1_2"), to its name in the tables."""
    known = switch_names(feeder)
    if text not in known:
        shown = [switch.alias or switch.name for switch in feeder.switches]
        hint = suggestion(text, shown, "switches", also=known)
        raise ValueError(f'switch "{text}": no such switch in feeder "{feeder.name}"; {hint}')
    return known[text]


def bus_islands(feeder: Tables, closed: Collection[str]) -> tuple[frozenset[str], ...]:
    """Return the sets of buses joined by branches and these closed switches, in the order of their first buses."""
    joined = [(one, other) for one, other, _ in feeder.branches()]
    joined += [(switch.from_bus, switch.to_bus) for switch in feeder.switches if switch.name in closed]
    return connected((bus.name for bus in feeder.buses), joined)


T = TypeVar("T", bound=Hashable)


def connected(things: Iterable[T], joined: Iterable[tuple[T, T]]) -> tuple[frozenset[T], ...]:
    """Return the sets of things that pairs join, directly or through others, in the order of their first things."""
    above = {thing: thing for thing in things}

    def root(thing: T) -> T:
        while above[thing] != thing:
            above[thing] = above[above[thing]]
            thing = above[thing]
        return thing

    for one, other in joined:
        above[root(one)] = root(other)
    members: dict[T, list[T]] = {}
    for thing in above:
        members.setdefault(root(thing), []).append(thing)
    return tuple(frozenset(group) for group in members.values())


def islands_after(feeder: Tables, operations: Iterable[SwitchOperations]) -> Iterator[tuple[frozenset[str], ...]]:
    """Yield the islands after each of some operations of switches, from those that are closed at the start."""
    closed = {switch.name for switch in feeder.switches if switch.closed}
    for opened, shut in operations:
        closed.difference_update(switch_name(feeder, name) for name in opened)
        closed.update(switch_name(feeder, name) for name in shut)
        yield bus_islands(feeder, closed)


Node = tuple[str, str]  # a bus and one of its phases


class Connectivity:
    """The graph of a feeder's nodes.

    Lines, regulators and switches join the nodes of each of their phases; a transformer, the substation and a
    grid-forming inverter of three phases join all three. Other equipment joins none.
    """

    def __init__(self, feeder: Tables) -> None:
        self._feeder = feeder
        self.nodes: tuple[Node, ...] = tuple((bus.name, phase) for bus in feeder.buses for phase in bus.phases)
        self._fixed: list[tuple[Node, Node]] = []
        branches: list[Line | Regulator] = [*feeder.lines, *feeder.regulators]
        for branch in branches:
            self._fixed += [((branch.from_bus, p), (branch.to_bus, p)) for p in branch.phases]
        for transformer in feeder.transformers:
            ends = (transformer.from_bus, transformer.to_bus)
            self._fixed += [((ends[0], "A"), (bus, phase)) for bus in ends for phase in PHASES]
        for element in feeder.elements:
            self._fixed += [
                (one, other)
                for i, one in enumerate(element.nodes)
                for j, other in enumerate(element.nodes[:i])
                if element.Y[i][j]
            ]

    def closed_at_start(self) -> frozenset[str]:
        return frozenset(switch.name for switch in self._feeder.switches if switch.closed)

    def parts(
        self, closed: Collection[str] | None = None, whole: Iterable[str] = (), tied: Iterable[tuple[Node, Node]] = ()
    ) -> tuple[frozenset[Node], ...]:
        """Return the sets of connected nodes, in the order of their first buses.

        `whole`: buses whose three phases count as one, because their source feeds all of them; `tied`: further pairs.
        """
        joined = [*self._fixed, *(((bus, "A"), (bus, phase)) for bus in whole for phase in PHASES), *tied]
        for switch in self._feeder.switches:
            if closed is None or switch.name in closed:
                joined += [((switch.from_bus, p), (switch.to_bus, p)) for p in switch.phases]
        return connected(self.nodes, joined)

    def fed(
        self, closed: Collection[str], forming: Iterable[InverterRow]
    ) -> tuple[tuple[frozenset[Node], ...], tuple[frozenset[Node], ...]]:
        """Return the parts that the substation or a connected grid-forming inverter feeds, and the others."""
        alive, whole = set[Node](), list[str]()
        for row in forming:
            alive.add(row.node)
            whole += [row.bus] if len(row.phases) > 1 else []
        if self._feeder.source:
            alive.add((self._feeder.source.bus, "A"))
            whole.append(self._feeder.source.bus)
        parts = self.parts(closed, whole)
        return tuple(part for part in parts if part & alive), tuple(part for part in parts if not part & alive)

    def cut_off(self, switch: Switch) -> frozenset[str]:
        """Return the buses that the substation does not reach with one of the closed switches open.

        In a feeder without a substation they are those that the switch's first bus does not reach.
        """
        source = self._feeder.source
        parts = self.parts(self.closed_at_start() - {switch.name}, [source.bus] if source else ())
        first = source.bus if source else switch.from_bus
        reached = {bus for part in parts if any(bus == first for bus, _ in part) for bus, _ in part}
        return frozenset(bus.name for bus in self._feeder.buses if bus.name not in reached)


def buses_without_ground(
    transformers: Collection[Transformer], lines: Iterable[Line], others: Iterable[Regulator | Switch]
) -> frozenset[str]:
    """Return the buses behind a delta winding, from which no current can return through ground."""
    grounded = [row for row in transformers if row.connection != "D-D"]
    deltas = [row for row in transformers if row.connection == "D-D"]
    joined = [(row.from_bus, row.to_bus) for row in (*lines, *others, *grounded)]
    parts = connected(dict.fromkeys([*chain(*joined), *(row.to_bus for row in deltas)]), joined)
    found: set[str] = set()
    for row in deltas:
        part = next(part for part in parts if row.to_bus in part)
        # where there is a way around it, the winding's own bus alone is certain
        found |= {row.to_bus} if row.from_bus in part else part
    return frozenset(found)


def by_bus(parts: Iterable[frozenset[Node]]) -> list[frozenset[Node]]:
    """Join the parts that are phases of the same buses: what cuts off one phase cuts off the others."""
    joined: list[frozenset[Node]] = []
    for part in parts:
        buses = {bus for bus, _ in part}
        same = [other for other in joined if buses & {bus for bus, _ in other}]
        joined = [*(other for other in joined if other not in same), part.union(*same)]
    return joined
