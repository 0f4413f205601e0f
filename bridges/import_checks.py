"""Steps of every import of a feeder: give problems their places, leave out what nothing feeds, make names plain."""

from __future__ import annotations

import csv
import fnmatch
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from gridpeers.plant.equipment import NODES, PHASES, Bus, Feeder, Source, Switch
from gridpeers.plant.equipment.connectivity import Connectivity, Node, by_bus, connected
from gridpeers.plant.equipment.imported_equipment import BEHIND, LinearElement, LoadPart, bus_behind
from gridpeers.plant.tables.feeder_columns import PART_CURRENT, power_of
from gridpeers.plant.tables.read import FeederError
from gridpeers.wire.wording import first_of

BEYOND = 100.0  # voltage (pu) that only a singular matrix gives
MATCH = 1e-6  # largest difference (pu of nominal voltage) of voltages that count as equal
TOLERANCE = 1e-11  # largest change of any voltage (pu) in the last iteration of our power flow
SHOWN_NAMES, SHOWN_BUSES = 5, 8
"""A sentence names at most so many loads, or buses of a section; a note on renamed buses names at most so many."""

MOST_UNFED = 0.5
"""Part of a feeder's load that may be without a path to the source; more of it is a mistake in the file."""


def number_of(letter: str) -> str:
    """Return the number of a bus's node in OpenDSS, 1 for A."""
    return str(NODES.index(letter) + 1)


def element_of(name: str, nodes: Sequence[Node], Y: Any) -> LinearElement:
    return LinearElement(name=name, nodes=tuple(nodes), Y=tuple(map(tuple, np.asarray(Y, complex).tolist())))


def bus_rows(
    places: Mapping[str, tuple[float, float, float]],
    added: Mapping[str, str],
    elements: Sequence[LinearElement],
    switches: Sequence[Switch],
    parts: Sequence[LoadPart],
    source: Source | None,
) -> tuple[Bus, ...]:
    """Return the buses to which anything is connected, with the phases that are used.

    `places` have the nominal voltage (V) and coordinates of each bus, in order. A bus in `added` follows the one that
    is given there, and has its place, unless it has one of its own.
    """
    used = {node for row in elements for node in row.nodes} | {(part.bus, p) for part in parts for p in part.ends}
    used |= {(bus, p) for row in switches for bus in (row.from_bus, row.to_bus) for p in row.phases}
    used |= {(source.bus, p) for p in PHASES} if source else set()
    after: dict[str, list[str]] = {name: [name] for name in places if name not in added}
    for name, like in added.items():
        after[like].append(name)
    found = []
    for like, names in after.items():
        for name in names:
            V_nom, x, y = places.get(name) or places[like]
            if phases := "".join(letter for letter in NODES if (name, letter) in used):
                found.append(Bus(name=name, phases=phases, V_nom=V_nom, x=x, y=y))
    return tuple(found)


def path_problems(path: Path) -> list[str]:
    if path.is_file():
        return []
    return [f"{path}: is a folder; name the file in it" if path.is_dir() else f"{path}: there is no such file"]


def refuse_if(path: Path, problems: Collection[str], places: Mapping[str, str] | None = None) -> None:
    """Raise a FeederError if there are problems, each with its file and line where `places` has them."""
    if problems:
        raise FeederError(path.name, tuple(placed(problem, places or {}) for problem in problems))


def placed(problem: str, places: Mapping[str, str]) -> str:
    """Return a problem after the file and line of the element that it begins with, if they are known.

    Where it begins with several elements, the place is that of the first.

    >>> places = {"load.a": "x.dss:7", "bus n 1": "x.dss:3"}
    >>> placed("load.a, load.b: constant power to ground", places), placed("buses n 1, n2 (first n 1.A): apart", places)
    ('x.dss:7: load.a, load.b: constant power to ground', 'x.dss:3: buses n 1, n2 (first n 1.A): apart')
    """
    at = problem.find(":")
    while at >= 0:
        several = problem[:at].replace("buses ", "bus ", 1)
        for name in (several, several.partition(", ")[0], several.partition(" (")[0], several.partition(BEHIND)[0]):
            if name in places:
                return f"{places[name]}: {problem}"
        at = problem.find(":", at + 1)
    return problem


def of_script(problem: str, folder: Path, script: str, places: Mapping[str, str]) -> str:
    """Return a problem of an imported feeder's tables ("buses.csv row 3: ...") with its place in the script instead.

    `folder` has the tables; `places` are those of the feeder.
    """
    found = re.match(r"(?P<file>\w+\.\w+)(?: row (?P<row>\d+))?: ", problem)
    if not found:
        return problem
    text = problem[found.end() :]
    if not found["row"]:
        return f"{script}: {text}"
    with (folder / found["file"]).open(newline="", encoding="utf-8") as stream:
        reader = csv.DictReader(stream)
        cells = next(cells for cells in reader if reader.line_num == int(found["row"]))
    name = (
        cells.get("element")
        or cells.get("load")
        or cells.get("alias")
        or f"bus {cells.get('bus', '').partition(BEHIND)[0]}"
    )
    subject = next((each for each in places if each in (name, f"bus {name}") or each.endswith(f".{name}")), name)
    return f"{places.get(subject, script)}: {subject}: {text}"


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


def report_powers(parts: Sequence[LoadPart], problems: list[str]) -> None:
    """Add a problem for each load whose power only a lost unit explains."""
    told: dict[str, str] = {}
    for part in parts:
        most = power_of("a load", part.V_nom, PART_CURRENT, 1)
        for power, unit in ((part.S.real / 1e3, "kW"), (part.S.imag / 1e3, "kvar")):
            text = most.objection(power, unit) if isfinite(power) else f"its power must be a number, got {power} {unit}"
            if text:
                told.setdefault(part.name, text)
    problems += [f"{name}: {text}" for name, text in told.items()]


def checked(
    path: Path, feeder: Feeder, problems: list[str], remedy: str, name_node: Callable[[str], str] = number_of
) -> Feeder:
    """Return an imported feeder without what nothing can feed; FeederError if it has problems.

    Left out, with a note each, are sections without a path to the source with all switches closed, and loads at a node
    to which nothing else leads: nothing flows there, so that the rest is what it was. If they have most of the load,
    they are problems. `remedy` says what to do where nothing determines a voltage to ground; `name_node` names a node
    by its letter as the imported program does.
    """
    if not problems:
        feeder = _without_unfed(feeder, name_node)
    supported, sections = _supported(feeder), _unfed_sections(feeder)
    alone: dict[tuple[str, str], set[str]] = {}
    for part in feeder.load_parts:
        for letter in part.ends:
            if letter and (part.bus, letter) not in supported:
                alone.setdefault((part.name, part.bus), set()).add(letter)
    for (name, bus), letters in alone.items():
        which = ", ".join(map(name_node, sorted(letters, key=NODES.index)))
        problems.append(
            f"{name}: node {which} of bus {bus} is connected to nothing but loads: a "
            "phase that does not come there, or an open neutral; connect or ground it"
        )
    for section in sections:
        problems.append(
            f"{_named(feeder, section & supported, name_node)}: no path to the source, even with all switches closed; "
            "connect or leave out what is there"
        )
    refuse_if(path, problems, feeder.places)
    from gridpeers.plant.network import Network  # a process that only reads loads no compiler of the plant's steps

    try:
        network = Network(feeder)
    except RuntimeError:  # of the factorisation
        problems.append(f"{path.name}: nothing determines some bus's voltage to ground; {remedy}")
    else:  # without load, such a voltage is beyond all bounds
        far = np.flatnonzero(np.abs(network.nominal) > BEYOND * network.V_nom)
        buses = dict.fromkeys(network.nodes[i][0] for i in far)
        problems += [f"bus {bus}: nothing determines its voltage to ground; {remedy}" for bus in buses]
    refuse_if(path, problems, feeder.places)
    return feeder


def _without_unfed(feeder: Feeder, name_node: Callable[[str], str]) -> Feeder:
    """Return a feeder without its unfed sections and idle loads, unless these have most of the load."""
    supported, sections = _supported(feeder), _unfed_sections(feeder)
    gone = frozenset[Node]().union(*sections)
    idle = _idle_parts(feeder, supported)
    parts = [part for part in feeder.load_parts if part in idle or (part.bus, part.ends[0]) in gone]
    unserved = sum(part.S.real for part in parts)
    if not (gone or parts) or unserved > MOST_UNFED * sum(part.S.real for part in feeder.load_parts):
        return feeder
    notes = list(feeder.notes)
    for section in sections:
        load = sum(part.S.real for part in parts if (part.bus, part.ends[0]) in section)
        with_load = f", with {load / 1e3:.3g} kW of load" if load else ""
        notes.append(f"{_named(feeder, section, name_node)}: no path to the source; left out{with_load}")
    if names := list(dict.fromkeys(part.name for part in idle)):
        notes.append(f"{first_of(names, SHOWN_NAMES)}: at a node to which nothing else leads; left out")
    kept = tuple(part for part in feeder.load_parts if part not in parts)
    used = supported | {(part.bus, letter) for part in kept for letter in part.ends}
    used |= {(bus, letter) for row in feeder.switches for bus in (row.from_bus, row.to_bus) for letter in row.phases}
    replace = msgspec.structs.replace
    buses = [
        replace(bus, phases="".join(p for p in bus.phases if (bus.name, p) in used - gone)) for bus in feeder.buses
    ]
    switches = [
        replace(row, phases="".join(p for p in row.phases if (row.from_bus, p) not in gone)) for row in feeder.switches
    ]
    return replace(
        feeder,
        buses=tuple(bus for bus in buses if bus.phases),
        switches=tuple(row for row in switches if row.phases),
        elements=tuple(row for row in feeder.elements if not set(row.nodes) & gone),
        load_parts=kept,
        notes=tuple(notes),
    )


def _supported(feeder: Feeder) -> set[Node]:
    """Return the nodes to which an element or the source leads, and not loads alone."""
    assert feeder.source is not None
    nodes = {node for row in feeder.elements for node, values in zip(row.nodes, row.Y, strict=True) if any(values)}
    return nodes | {(feeder.source.bus, letter) for letter in PHASES}


def _unfed_sections(feeder: Feeder) -> list[frozenset[Node]]:
    """Return the sections that have no path to the source, not even through loads, with all switches closed."""
    assert feeder.source is not None
    through_loads = [
        ((part.bus, one), (part.bus, other)) for part in feeder.load_parts for one, other in [part.ends] if other
    ]
    source, supported = feeder.source.bus, _supported(feeder)
    parts = Connectivity(feeder).parts(whole=[source], tied=through_loads)
    return by_bus(part for part in parts if (source, "A") not in part and part & supported)


def _idle_parts(feeder: Feeder, supported: Collection[Node]) -> list[LoadPart]:
    """Return the load parts through which no current can flow.

    Nodes that only loads lead to, and their loads, form groups; a group that touches one other node, or ground alone,
    has no second way for a current.
    """
    ends = [[(part.bus, letter) if letter else ("", "") for letter in part.ends] for part in feeder.load_parts]
    loose = dict.fromkeys(node for pair in ends for node in pair if node[1] and node not in supported)
    groups = connected(loose, [(one, other) for one, other in ends if one in loose and other in loose])
    group_of = {node: group for group in groups for node in group}
    touched: dict[frozenset[Node], set[Node]] = {group: set() for group in groups}
    for one, other in ends:
        for node, opposite in ((one, other), (other, one)):
            if node in loose and opposite not in loose:
                touched[group_of[node]].add(opposite)
    return [
        part
        for part, pair in zip(feeder.load_parts, ends, strict=True)
        if any(node in loose and len(touched[group_of[node]]) <= 1 for node in pair)
    ]


def _named(feeder: Feeder, section: Collection[Node], name_node: Callable[[str], str]) -> str:
    nodes = [(bus.name, letter) for bus in feeder.buses for letter in bus.phases if (bus.name, letter) in section]
    buses = list(dict.fromkeys(bus for bus, _ in nodes))
    first = ", ".join(f"{bus}.{name_node(letter)}" for bus, letter in nodes if bus == buses[0])
    return f"bus{'es' if len(buses) > 1 else ''} {first_of(buses, SHOWN_NAMES)} (first {first})"


def difference(feeder: Feeder, theirs: Mapping[Node, complex]) -> tuple[float, Node]:
    """Return the largest difference (pu) between our voltages and another program's, `theirs` (V), and its node.

    ArithmeticError if our power flow does not converge.
    """
    from gridpeers.plant.network import Network, solve_power_flow

    network = Network(feeder)
    V = solve_power_flow(network, network.closed0, tolerance=TOLERANCE).V
    at = [k for k, node in enumerate(network.nodes) if node in theirs]
    given = np.array([theirs[network.nodes[k]] for k in at])
    # where the given voltage is far above the nominal one, the nominal one is not what the script means
    off = np.abs(V[at] - given) / np.maximum(network.V_nom[at], np.abs(given))
    worst = int(np.argmax(off))
    return float(off[worst]), network.nodes[at[worst]]


def with_plain_names(feeder: Feeder, added: Mapping[str, str]) -> Feeder:
    """Return a feeder in which "_" stands for what a bus's name cannot have; its notes name these buses.

    That is blanks, "~", and characters that cannot be printed. Where two buses would have the same name, the later one
    ends with "_2". `added` has the buses that the import has added, and the bus before each.
    """
    names = dict.fromkeys([*(bus.name for bus in feeder.buses if bus.name not in added), *added.values()])
    buses = {name: name for name in names if _plain(name) == name}
    for name in names:
        if name not in buses:
            new, number = _plain(name), 2
            while new in buses.values():
                new, number = f"{_plain(name)}_{number}", number + 1
            buses[name] = new
    renamed = [f'"{old}" is {buses[old]}' for old in names if old != buses[old]]
    for name, like in added.items():
        buses[name] = bus_behind(buses[like], _plain(name.removeprefix(bus_behind(like, ""))))
    if all(old == new for old, new in buses.items()):
        return feeder
    replace = msgspec.structs.replace
    note = f"buses have other names here, without blanks: {first_of(renamed, SHOWN_BUSES)}"
    ends = [(buses[row.from_bus], buses[row.to_bus]) for row in feeder.switches]
    places = {f"bus {old}": f"bus {new}" for old, new in buses.items()}
    return replace(
        feeder,
        buses=tuple(replace(bus, name=buses[bus.name]) for bus in feeder.buses),
        elements=tuple(
            replace(row, nodes=tuple((buses[bus], letter) for bus, letter in row.nodes)) for row in feeder.elements
        ),
        load_parts=tuple(replace(part, bus=buses[part.bus]) for part in feeder.load_parts),
        switches=tuple(
            replace(row, name=f"{one}-{other}", from_bus=one, to_bus=other)
            for row, (one, other) in zip(feeder.switches, ends, strict=True)
        ),
        source=feeder.source and replace(feeder.source, bus=buses[feeder.source.bus]),
        notes=(*feeder.notes, *([note] if renamed else [])),
        places={places.get(name, name): place for name, place in feeder.places.items()},
    )


def _plain(name: str) -> str:
    return "".join(letter if letter.isprintable() and letter not in {" ", BEHIND} else "_" for letter in name)
