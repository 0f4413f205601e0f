"""A first proposal for a feeder of one's own: where to island it, and which inverters to put where."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

from plant.connectivity import Connectivity, by_bus
from plant.equipment import Feeder, InverterRow

RATING = 1.3
"""Rating of all inverters of a section beside its load at nominal voltage."""
IMPORTED = 0.1
"""Part of the load that comes over the islanding switch before it opens."""
LEADER = 0.4
"""Part of a section's rating that its leader, the grid-forming inverter, has."""
FOLLOWERS = 2
"""Grid-following inverters of a section."""
ENOUGH = 0.5
"""Part of the feeder's load that the switch must cut off, to be worth islanding."""
SMALLEST = 20e3
"""Load (W) below which a section has no inverters of its own."""
DROOPS = 0.01, 0.05
"""P-f and Q-V droop (pu)."""
LINES = {"line": "Line", "overhead_line": "overhead_line", "underground_line": "underground_line"}
"""Classes of lines in OpenDSS and GridLAB-D, as a line that is to be a switch is written."""
MOST_SECTIONS = 12
"""Sections that have inverters, those of most load first."""


class Proposal(NamedTuple):
    """A first islanding of a feeder: the switch, the inverters, their set-points."""

    switch: str
    """The switch to island at, by its alias or name."""
    inverters: tuple[InverterRow, ...]
    P_set0: float
    """First P_set of every inverter (pu of its rating)."""
    load: float
    """Load (W) beyond the switch."""


class NoProposalError(ValueError):
    """A feeder that cannot be islanded as it is; the text says what to add."""


class NoSwitchError(NoProposalError):
    """No switch cuts half of the load off the substation.

    Attributes
    ----------
    lines : tuple of str
        Lines near the substation that would make switches.
    """

    def __init__(self, lines: Sequence[str]) -> None:
        self.lines = tuple(lines)
        hint = f"name a line to be one, such as {', '.join(lines)}" if lines else "it has no three-phase line to be one"
        super().__init__(f"no switch cuts half of the load off the substation; {hint}")


def propose(feeder: Feeder) -> Proposal:
    """Return where to island a feeder, and inverters that can then carry its load.

    The switch is the one that cuts off most load. Each section between switches beyond it has a leader and followers,
    rated by its load and spread over its three-phase buses.

    Raises
    ------
    NoProposalError
        If no switch cuts off half of the load, or no section beyond it has a three-phase bus for each inverter.
    """
    switch, beyond = _islanding_switch(feeder)
    everywhere = feeder.load_by_bus()
    load = {bus: everywhere.get(bus, 0.0) for bus in beyond}
    total = sum(load.values())
    phases = {bus.name: bus.phases for bus in feeder.buses}
    sections = [
        section
        for part in by_bus(Connectivity(feeder).parts(closed=()))
        if (section := {bus for bus, _ in part} & beyond) and _places(feeder, section, phases)
    ]
    sections.sort(key=lambda section: -sum(load[bus] for bus in section))
    chosen = [s for s in sections if sum(load[bus] for bus in s) >= SMALLEST][:MOST_SECTIONS] or sections[:1]
    if not chosen:
        raise NoProposalError(f'beyond switch "{switch}" no bus has phases A, B and C, which an inverter needs')
    carried = sum(load[bus] for section in chosen for bus in section) or 1.0
    inverters: list[InverterRow] = []
    V_nom = {bus.name: bus.V_nom for bus in feeder.buses}
    for number, section in enumerate(chosen, start=1):
        own = sum(load[bus] for bus in section)
        rating = RATING * total * (own / carried if carried > 1.0 else 1.0 / len(chosen))
        places = _spread(_places(feeder, section, phases), 1 + FOLLOWERS)
        middle = len(places) // 2  # a leader at one end of a long line does not hold the other
        follower = (1.0 - LEADER) / max(len(places) - 1, 1)
        for k, bus in enumerate(places):
            share = LEADER if k == middle else follower
            inverters.append(
                InverterRow(
                    name=f"inv{len(inverters) + 1}",
                    kind="GFM" if k == middle else "GFL",
                    bus=bus,
                    microgrid=f"MG{number}",
                    P_rated=max(round(rating * share, -4), 10e3),
                    V_nom=V_nom[bus],
                    m_p=DROOPS[0],
                    m_q=DROOPS[1],
                )
            )
    rated = sum(row.P_rated for row in inverters)
    generated = sum(P for bus, P in feeder.generation_by_bus().items() if bus in beyond)
    P_set0 = max(round(((1.0 - IMPORTED) * total - generated) / rated, 3), 0.0)
    return Proposal(switch, tuple(inverters), P_set0, total)


def _islanding_switch(feeder: Feeder) -> tuple[str, frozenset[str]]:
    """Return the closed switch that cuts most load off the substation, and the buses beyond it."""
    if feeder.source is None:
        raise NoProposalError("the feeder has no substation to island from")
    graph, load = Connectivity(feeder), feeder.load_by_bus()
    if sum(load.values()) <= 0.0:
        raise NoProposalError("the feeder has no load, which inverters are rated by")
    best, beyond, most = "", frozenset[str](), (0.0, 0)
    for switch in feeder.switches:
        buses = graph.cut_off(switch) if switch.closed else frozenset()
        weight = sum(load.get(bus, 0.0) for bus in buses), len(buses)
        if weight > most:
            best, beyond, most = switch.alias or switch.name, buses, weight
    if most[0] < ENOUGH * sum(load.values()):
        raise NoSwitchError(heads(feeder))
    return best, beyond


def heads(feeder: Feeder, count: int = 3) -> list[str]:
    """Return three-phase lines near the substation, which would make switches."""
    if feeder.source is None:
        return []
    reached: set[str] = {feeder.source.bus}
    found: list[str] = []
    rest = [row for row in feeder.elements if len({bus for bus, _ in row.nodes}) > 1]
    for _ in range(len(rest)):
        near = [row for row in rest if any(bus in reached for bus, _ in row.nodes)]
        if not near or len(found) >= count:
            break
        for row in near:
            reached |= {bus for bus, _ in row.nodes}
            kind, _, name = row.name.partition(".")
            if kind in LINES and len(row.nodes) >= 6:
                found.append(f"{LINES[kind]}.{name}")
        rest = [row for row in rest if row not in near]
    return found[:count]


def _places(feeder: Feeder, section: Collection[str], phases: dict[str, str]) -> list[str]:
    """Return the buses of a section at which an inverter can stand, of the section's most frequent voltage."""
    rows = [bus for bus in feeder.buses if bus.name in section and set("ABC") <= set(phases[bus.name])]
    rows = [bus for bus in rows if "~" not in bus.name] or rows
    if not rows:
        return []
    voltages = [round(bus.V_nom) for bus in rows]
    usual = max(set(voltages), key=voltages.count)
    ends = {bus for switch in feeder.switches for bus in (switch.from_bus, switch.to_bus)}
    named = [bus.name for bus in rows if round(bus.V_nom) == usual]
    return [bus for bus in named if bus not in ends] or named


def _spread(places: list[str], count: int) -> list[str]:
    """Return so many places, evenly spread over a section in the order of its buses."""
    count = min(count, len(places))
    return [places[(2 * k + 1) * len(places) // (2 * count)] for k in range(count)]
