"""A first proposal for a feeder of one's own: where to island it, and which inverters to put where."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import accumulate
from math import ceil
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from gridpeers.plant.equipment import PHASES, InverterRow, Tables
from gridpeers.plant.equipment.connectivity import Connectivity, by_bus
from gridpeers.plant.equipment.imported_equipment import is_behind
from gridpeers.plant.equipment.neutrals import neutral_for, neutrals_of
from gridpeers.plant.network import Network
from gridpeers.plant.network.powerflow import solve_power_flow
from gridpeers.plant.tables.feeder_columns import RATED_CURRENT, power_of

ENOUGH = 0.5  # part of the feeder's load that the switch must cut off, to be worth islanding
LINES = {"line": "Line", "overhead_line": "overhead_line", "underground_line": "underground_line"}
"""Classes of lines in OpenDSS and GridLAB-D, as a line that is to be a switch is written."""


def islanding_switch(feeder: Tables) -> tuple[str, str, frozenset[str]]:
    """Return the closed switch that cuts most load off the substation, its far bus, and the buses beyond it."""
    if feeder.source is None:
        raise NoProposalError("the feeder has no substation to island from")
    graph, load = Connectivity(feeder), feeder.load_by_bus()
    total = sum(load.values())
    if total <= 0.0:
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
    if not large or cut_off < ENOUGH * total:
        lines = _heads(feeder, feeder.source.bus, places, more_than=1.01 * cut_off, small=not large)
        if lines or cut_off <= 0.0:
            raise NoSwitchError(lines)
    return best, head, beyond


def _heads(feeder: Tables, source: str, three_phase: set[str], more_than: float, *, small: bool) -> list[str]:
    """Return up to three three-phase lines that would make switches, the best first.

    They cut off more than so much load (W): half of all load or more as near to the substation as possible, else
    as much as possible. Lines that cut off a lumped load come last, and only with `small`.
    """
    load, near = feeder.load_by_bus(), neighbours(feeder)
    where = {bus: place for place, bus in enumerate(depth_first(near, [source]))}
    parallel = Counter(frozenset((one, other)) for one, other, _ in feeder.branches())
    below, places = (cut_off_sums(near, source, what) for what in (load, dict.fromkeys(three_phase, 1.0)))
    found: list[tuple[bool, bool, float, int, str]] = []
    for row in feeder.elements:
        kind, _, name = row.name.partition(".")
        buses = {bus for bus, _ in row.nodes}
        if kind in LINES and len(row.nodes) >= 6 and len(buses) == 2 and parallel[frozenset(buses)] == 1:
            one, other = sorted(buses, key=lambda bus: where.get(bus, -1))
            weight, lumped = below.get((one, other), 0.0), places.get((one, other), 0.0) < GROUP
            if weight > more_than and (small or not lumped):
                enough = weight >= ENOUGH * sum(load.values())
                nearness = where[one] if enough else -weight
                found.append((lumped, not enough, nearness, where[one], f"{LINES[kind]}.{name}"))
    return [name for *_, name in sorted(found)[:3]]


def three_phase(feeder: Tables) -> list[str]:
    """Return the buses that have phases A, B and C, unless some of them are de-energised and others not."""
    graph = Connectivity(feeder)
    fed = {node for part in graph.fed(graph.closed_at_start(), ())[0] for node in part}
    rows = [bus for bus in feeder.buses if set("ABC") <= set(bus.phases)]
    return [bus.name for bus in rows if len({(bus.name, phase) in fed for phase in "ABC"}) == 1]


def possible_places(
    feeder: Tables, known: Collection[str], section: Collection[str], rating: float, count: int
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


GROUP = 3
"""Inverters of a group, a microgrid of its own: one leader and its followers. A section has one group or several."""
GROUP_LOAD = 2e6  # load (W) beyond which a section has more groups: one leader does not hold the ends of a long feeder
MOST_GROUPS = 12  # groups that are proposed for all sections together, about


def phase_powers(feeder: Tables, switch: str, head: str) -> NDArray[np.complex128]:
    """Return the power (VA) through a switch of each phase of its far side, while the substation feeds everything.

    It is without fixed generation. So loads between phases, behind transformers and on split-phase services count where
    they come from. It is empty where the power flow has no solution.
    """
    loads = tuple(part for part in feeder.load_parts if part.S.real >= 0.0)
    network = Network(replace(feeder, load_parts=loads, inverters=()))
    try:
        V = solve_power_flow(network, network.closed0)
    except ArithmeticError:
        return np.empty(0, np.complex128)
    without = network.closed0 - {network.switch_name(switch)}
    merge = network.merge(without)
    through = network.admittance(without) @ V + merge.gather(network.loads().currents(V))
    at = [int(merge.representative[network.index(head, phase)]) for phase in PHASES if network.has(head, phase)]
    S: NDArray[np.complex128] = V[at] * through[at].conj()
    return S


def heaviest_phase(S: NDArray[np.complex128]) -> float:
    """Return the load of the heaviest phase in relation to the mean of all, from the power (VA) of each; 1 of none."""
    return float(3.0 * S.real.max() / S.real.sum()) if S.real.sum() > 0.0 else 1.0


def neighbours(feeder: Tables) -> dict[str, list[str]]:
    near: dict[str, list[str]] = {bus.name: [] for bus in feeder.buses}
    ties = [(switch.from_bus, switch.to_bus) for switch in feeder.switches if switch.closed]
    for one, other in [*((one, other) for one, other, _ in feeder.branches()), *ties]:
        near[one].append(other)
        near[other].append(one)
    return near


def depth_first(near: Mapping[str, Sequence[str]], roots: Iterable[str]) -> list[str]:
    """Return the buses that are reached, each branch to its end before the next one."""
    found: dict[str, None] = {}
    for root in roots:
        waiting = [root]
        while waiting:
            bus = waiting.pop()
            if bus not in found:
                found[bus] = None
                waiting += reversed(near[bus])
    return list(found)


def cut_off_sums(
    near: Mapping[str, Sequence[str]], root: str, what: Mapping[str, float]
) -> dict[tuple[str, str], float]:
    """Return what each branch, (nearer bus, farther bus), cuts off of a sum over buses; in a loop none does."""
    order = depth_first(near, [root])
    place = {bus: k for k, bus in enumerate(order)}
    above: dict[str, str] = {}
    for bus in order:  # in the order of a depth-first search the last neighbour before a bus is the one it came from
        before = [other for other in near[bus] if place[other] < place[bus]]
        if before:
            above[bus] = max(before, key=lambda other: place[other])
    lowest, weight = dict(place), {bus: what.get(bus, 0.0) for bus in order}
    cut: dict[tuple[str, str], float] = {}
    for bus in reversed(order):
        for other in near[bus]:
            if other != above.get(bus):
                lowest[bus] = min(lowest[bus], lowest[other] if above.get(other) == bus else place[other])
        if bus in above:
            if lowest[bus] >= place[bus]:
                cut[above[bus], bus] = weight[bus]
            weight[above[bus]] += weight[bus]
    return cut


class NoProposalError(ValueError):
    """A feeder that cannot be islanded as it is; the text says what to add."""


class NoSwitchError(NoProposalError):
    """No switch cuts half of the load off the substation."""

    def __init__(self, lines: Sequence[str]) -> None:
        self.lines = tuple(lines)
        hint = f"make a line a switch, e.g. --switch {lines[0]}" if lines else "no single three-phase line does either"
        super().__init__(f"no switch cuts half of the load off the substation; {hint}")


RATING = 1.3
"""Rating of all inverters of a section beside its load at nominal voltage, were all phases loaded as the heaviest."""
IMPORTED = 0.1  # part of the load, less the fixed generation, that comes over the islanding switch before it opens
LEADER = 0.4  # part of a group's rating that its leader, the grid-forming inverter, has
SMALLEST = 20e3  # load (W) below which a section has no inverters of its own
DROOPS = 0.01, 0.05  # P-f and Q-V droop (pu)


class Proposal(NamedTuple):
    """A first islanding of a feeder: the switch, the inverters, their set-points."""

    switch: str  # the switch to island at, by its alias or name
    inverters: tuple[InverterRow, ...]
    P_set0: float  # first P_set of every inverter (pu of its rating)
    load: float  # load (W) beyond the switch
    heaviest: float  # load of the heaviest phase in relation to the mean of the phases


def propose(feeder: Tables) -> Proposal:
    """Return where to island a feeder, and inverters that can then carry its load; its own are not considered.

    The switch is the one that cuts off most load. Each section between switches beyond it has a leader and followers,
    rated by its load and that of the heaviest phase, or by what its cables deliver, and spread over it in equal parts
    of the load. Sections of more load have more such groups, and so do those where a leader would be larger than its
    voltage allows.
    """
    switch, head, beyond = islanding_switch(feeder)
    everywhere = feeder.load_by_bus()
    load = {bus: everywhere.get(bus, 0.0) for bus in beyond}
    total = sum(load.values())
    generation = sum(P for bus, P in feeder.generation_by_bus().items() if bus in beyond)
    S = phase_powers(feeder, switch, head)
    heaviest = heaviest_phase(S)
    # leaders alone can take the reactive power that cables deliver
    needed = max(RATING * heaviest * total, -S.imag.sum() / LEADER)
    near = {bus: [other for other in others if other in beyond] for bus, others in neighbours(feeder).items()}
    along = depth_first(near, [head, *(bus.name for bus in feeder.buses if bus.name in beyond)])
    known = set(three_phase(feeder))
    sections = [
        (sum(load[bus] for bus in buses), [bus for bus in along if bus in buses])
        for part in by_bus(Connectivity(feeder).parts(closed=()))
        if len(buses := {bus for bus, _ in part} & beyond) > 1 and buses & known
    ]
    sections.sort(key=lambda section: -section[0])
    chosen = [section for section in sections if section[0] >= SMALLEST][:MOST_GROUPS] or sections[:1]
    if not chosen:
        raise NoProposalError(f'beyond switch "{switch}" no bus has phases A, B and C, which an inverter needs')
    carried = sum(of_section for of_section, _ in chosen) or 1.0
    group_load = max(GROUP_LOAD, carried / MOST_GROUPS)
    rows, neutrals = {bus.name: bus for bus in feeder.buses}, neutrals_of(feeder)
    inverters: list[InverterRow] = []
    microgrid = 0
    for of_section, section in chosen:
        rating = needed * (of_section / carried if carried > 1.0 else 1.0 / len(chosen))
        for own in _groups(feeder, known, section, load, rating, max(1, ceil(of_section / group_load))):
            microgrid += 1
            middle = len(own) // 2  # a leader at one end of a long line does not hold the other
            follower = (1.0 - LEADER) / max(len(own) - 1, 1)
            for k, (bus, of_group) in enumerate(own.items()):
                share = (LEADER if k == middle else follower) if len(own) > 1 else 1.0
                row = InverterRow(
                    name=f"inv{len(inverters) + 1}",
                    kind="GFM" if k == middle else "GFL",
                    bus=bus,
                    microgrid=f"MG{microgrid}",
                    P_rated=max(round(of_group * share, -4), 10e3),
                    V_nom=rows[bus].V_nom,
                    m_p=DROOPS[0],
                    m_q=DROOPS[1],
                    neutral=neutral_for("", rows[bus], "ABC", neutrals.get(bus, "")),
                )
                if row.P_rated > (most := most_rated(row.V_nom)):
                    raise NoProposalError(
                        f"the load of {total / 1e3:.0f} kW needs an inverter of {row.P_rated / 1e3:.0f} kW at bus "
                        f"{bus}, where {most / 1e3:.0f} kW are plausible; try another --switch"
                    )
                inverters.append(row)
    total_rated = sum(row.P_rated for row in inverters)
    P_set0 = (1.0 - IMPORTED) * max(total - generation, 0.0) / total_rated
    return Proposal(switch, tuple(inverters), round(P_set0, 3), total, heaviest)


def _groups(
    feeder: Tables, known: set[str], section: Sequence[str], load: Mapping[str, float], rating: float, number: int
) -> list[dict[str, float]]:
    """Return the buses of each group of a section, each with the rating (W) of its group.

    There are so many groups, or more if a leader were larger than its voltage allows, as far as there are buses.
    """
    rows = {bus.name: bus for bus in feeder.buses}
    while True:
        places = possible_places(feeder, known, section, LEADER * rating / number, GROUP * number)
        enough = min(len(places) // GROUP, ceil(LEADER * rating / most_rated(rows[places[0]].V_nom)))
        if enough <= number:
            break
        number = enough
    number = max(1, min(number, len(places) // GROUP))
    chosen = spread(section, set(places), GROUP * number, load)
    return [dict.fromkeys(chosen[k : k + GROUP], rating / number) for k in range(0, len(chosen), GROUP)]
