"""Checks that all imports of feeders share: elements left out by name, nodes whose voltage nothing determines."""

from __future__ import annotations

import fnmatch
from collections.abc import Callable, Collection, Sequence
from pathlib import Path

import numpy as np

from plant.equipment import NODES, PHASES, Feeder
from plant.equipment.connectivity import Connectivity, by_bus
from plant.network import Network
from plant.tables.read import FeederError

BEYOND = 100.0
"""Voltage (pu) that only a singular matrix gives."""

SHOWN = 5
"""How many buses of a floating section a problem names."""


def number_of(letter: str) -> str:
    """Return the number of a bus's node, which stands for its letter in OpenDSS: 1 for A."""
    return str(NODES.index(letter) + 1)


def refuse_if(path: Path, problems: Collection[str]) -> None:
    """Raise a FeederError if there are problems."""
    if problems:
        raise FeederError(path.name, tuple(problems))


def left_out_by(names: Sequence[str], patterns: Sequence[str], problems: list[str], example: str) -> set[str]:
    """Return the elements that patterns match; note a problem for each pattern that matches none."""
    by_lower = {name.lower(): name for name in names}
    left_out: set[str] = set()
    for pattern in patterns:
        matching = fnmatch.filter(by_lower, pattern.lower())
        if not matching:
            problems.append(f'leave_out: "{pattern}" matches no element; write Class.name, e.g. "{example}"')
        left_out.update(by_lower[name] for name in matching)
    return left_out


def refuse_unsolvable(
    path: Path, feeder: Feeder, problems: list[str], remedy: str, name_node: Callable[[str], str] = number_of
) -> None:
    """Raise a FeederError if an import has problems, or if its feeder has nodes without a determined voltage.

    Parameters
    ----------
    path
        The imported file.
    feeder
        Its feeder, with a source.
    problems
        Problems of the import so far.
    remedy
        What to do where nothing determines a voltage to ground.
    name_node
        Name of a node in the imported program, from its letter.
    """
    _report_unconnected(feeder, problems, name_node)
    refuse_if(path, problems)
    _report_undetermined(feeder, problems, remedy)
    refuse_if(path, problems)


def _report_unconnected(feeder: Feeder, problems: list[str], name_node: Callable[[str], str]) -> None:
    """Add a problem for each node that loads alone lead to, and each section without the source, switches closed."""
    assert feeder.source is not None
    held = {node for row in feeder.elements for node, values in zip(row.nodes, row.Y, strict=True) if any(values)}
    held |= {(feeder.source.bus, letter) for letter in PHASES}
    alone: dict[tuple[str, str], set[str]] = {}
    for part in feeder.load_parts:
        for letter in part.ends:
            if letter and (part.bus, letter) not in held:
                alone.setdefault((part.name, part.bus), set()).add(letter)
    for (name, bus), letters in alone.items():
        which = ", ".join(map(name_node, sorted(letters, key=NODES.index)))
        problems.append(
            f"{name}: node {which} of bus {bus} is connected to nothing but loads: a "
            "phase that does not come there, or an open neutral; connect or ground it"
        )
    graph = Connectivity(feeder)
    through_loads = [
        ((part.bus, one), (part.bus, other)) for part in feeder.load_parts for one, other in [part.ends] if other
    ]
    source = feeder.source.bus
    parts = graph.parts(whole=[source], tied=through_loads)
    for section in by_bus(part for part in parts if (source, "A") not in part and part & held):
        nodes = [node for node in graph.nodes if node in section & held]
        buses = list(dict.fromkeys(bus for bus, _ in nodes))
        more = f" and {len(buses) - SHOWN} more" if len(buses) > SHOWN else ""
        first = ", ".join(f"{bus}.{name_node(letter)}" for bus, letter in nodes if bus == buses[0])
        problems.append(
            f"bus{'es' if len(buses) > 1 else ''} {', '.join(buses[:SHOWN])}{more} (first {first}): no path to the "
            "source, even with all switches closed; connect or leave out what is there"
        )


def _report_undetermined(feeder: Feeder, problems: list[str], remedy: str) -> None:
    """Add a problem for each bus whose voltage to ground nothing determines: without load it is beyond all bounds."""
    try:
        network = Network(feeder)
    except RuntimeError:  # of the factorisation
        problems.append(f"nothing determines some bus's voltage to ground; {remedy}")
        return
    far = np.flatnonzero(np.abs(network.nominal) > BEYOND * network.V_nom)
    for bus in dict.fromkeys(network.nodes[i][0] for i in far):
        problems.append(f"bus {bus}: nothing determines its voltage to ground; {remedy}")
