"""A first proposal for a feeder of one's own: where to island it, and which inverters to put where."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from gridpeers.bridges.proposal.feeder_walk import depth_first, neighbours
from gridpeers.bridges.proposal.inverter_groups import GROUP, MOST_GROUPS, group_sizes
from gridpeers.bridges.proposal.inverter_places import most_rated, possible_places, spread, three_phase
from gridpeers.bridges.proposal.islanding_switch import islanding_switch
from gridpeers.bridges.proposal.phase_loads import heaviest_phase, phase_powers
from gridpeers.bridges.proposal.proposal_errors import NoProposalError, TooLargeError
from gridpeers.plant.equipment import Feeder, InverterRow
from gridpeers.plant.equipment.connectivity import Connectivity, by_bus
from gridpeers.plant.equipment.neutrals import neutral_for, neutrals_of

RATING = 1.3
"""Rating of all inverters of a section beside its load at nominal voltage, were all phases loaded as the heaviest."""
IMPORTED = 0.1
"""Part of the load, less the fixed generation, that comes over the islanding switch before it opens."""
LEADER = 0.4
"""Part of a group's rating that its leader, the grid-forming inverter, has."""
SMALLEST = 20e3
"""Load (W) below which a section has no inverters of its own."""
DROOPS = 0.01, 0.05
"""P-f and Q-V droop (pu)."""
MOST_TRIES = 8
"""Counts that are tried where the inverters of the first one would be too large."""


class Proposal(NamedTuple):
    """A first islanding of a feeder: the switch, the inverters, their set-points."""

    switch: str
    """The switch to island at, by its alias or name."""
    inverters: tuple[InverterRow, ...]
    P_set0: float
    """First P_set of every inverter (pu of its rating)."""
    load: float
    """Load (W) beyond the switch."""
    generation: float
    """Fixed generation (W) beyond the switch."""
    heaviest: float
    """Load of the heaviest phase in relation to the mean of the phases."""


def propose(feeder: Feeder, count: int | None = None) -> Proposal:
    """Return where to island a feeder, and inverters that can then carry its load.

    The switch is the one that cuts off most load. Each section between switches beyond it has a leader and followers,
    rated by its load and that of the heaviest phase, or by what its cables deliver, and spread over it in equal parts
    of the load.

    Parameters
    ----------
    feeder : Feeder
        The feeder; its own inverters are not considered.
    count : int, optional
        Inverters to propose; by default one group for each section. Sections of more load have more groups, and all
        have more where an inverter would be larger than its voltage allows.

    Raises
    ------
    NoProposalError
        If no switch cuts off half of the load, no section beyond it has a three-phase bus for an inverter, or so many
        inverters cannot carry the load at their voltage.
    """
    try:
        return _propose(feeder, count)
    except TooLargeError as error:
        if count is not None:
            raise
        problem = error
    for _ in range(MOST_TRIES):
        try:
            return _propose(feeder, problem.needed)
        except TooLargeError as error:
            if error.needed <= problem.needed:  # there are no buses for more
                break
            problem = error
    raise problem


def _propose(feeder: Feeder, count: int | None) -> Proposal:
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
        _Section(sum(load[bus] for bus in buses), [bus for bus in along if bus in buses])
        for part in by_bus(Connectivity(feeder).parts(closed=()))
        if len(buses := {bus for bus, _ in part} & beyond) > 1 and buses & known
    ]
    sections.sort(key=lambda section: -section.load)
    chosen = [section for section in sections if section.load >= SMALLEST][:MOST_GROUPS] or sections[:1]
    if not chosen:
        raise NoProposalError(f'beyond switch "{switch}" no bus has phases A, B and C, which an inverter needs')
    there = [len(possible_places(feeder, known, section.along, 0.0, GROUP)) for section in chosen]
    groups = group_sizes([section.load for section in chosen], there, count)
    chosen = chosen[: len(groups)]
    carried = sum(section.load for section in chosen) or 1.0
    rows, neutrals = {bus.name: bus for bus in feeder.buses}, neutrals_of(feeder)
    inverters: list[InverterRow] = []
    microgrid = 0
    for section, sizes in zip(chosen, groups, strict=True):
        rating = needed * (section.load / carried if carried > 1.0 else 1.0 / len(chosen))
        places = possible_places(feeder, known, section.along, LEADER * rating / len(sizes), sum(sizes))
        places = spread(section.along, set(places), sum(sizes), load)
        for size in sizes:
            microgrid += 1
            own, places = places[:size], places[size:]
            middle = size // 2  # a leader at one end of a long line does not hold the other
            follower = (1.0 - LEADER) / max(size - 1, 1)
            for k, bus in enumerate(own):
                share = (LEADER if k == middle else follower) if size > 1 else 1.0
                inverters.append(
                    InverterRow(
                        name=f"inv{len(inverters) + 1}",
                        kind="GFM" if k == middle else "GFL",
                        bus=bus,
                        microgrid=f"MG{microgrid}",
                        P_rated=max(round(rating / len(sizes) * share, -4), 10e3),
                        V_nom=rows[bus].V_nom,
                        m_p=DROOPS[0],
                        m_q=DROOPS[1],
                        neutral=neutral_for("", rows[bus], "ABC", neutrals.get(bus, "")),
                    )
                )
    large = max(inverters, key=lambda row: row.P_rated / most_rated(row.V_nom))
    if large.P_rated > (most := most_rated(large.V_nom)):
        raise TooLargeError(large, most, total, len(inverters))
    total_rated = sum(row.P_rated for row in inverters)
    P_set0 = (1.0 - IMPORTED) * max(total - generation, 0.0) / total_rated
    return Proposal(switch, tuple(inverters), round(P_set0, 3), total, generation, heaviest)


class _Section(NamedTuple):
    """Buses between switches."""

    load: float
    """Their load (W)."""
    along: Sequence[str]
    """The buses, along the network."""
