"""A feeder that another program has read: its rows, notes and problems, and the checks of every import."""

from __future__ import annotations

import csv
import fnmatch
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from msgspec.structs import replace

from gridpeers.plant.equipment import F_NOM, NODES, PHASES, Bus, Source, Switch, Tables
from gridpeers.plant.equipment.connectivity import Connectivity, Node, by_bus, connected
from gridpeers.plant.equipment.imported_equipment import BEHIND, LinearElement, LoadPart, bus_behind
from gridpeers.plant.tables.feeder_columns import PART_CURRENT, power_of
from gridpeers.plant.tables.read import FeederError
from gridpeers.wire.wording import first_of

BEYOND = 100.0  # voltage (pu) that only a singular matrix gives
MATCH = 1e-6  # largest difference (pu of nominal voltage) of voltages that count as equal
SHOWN_NAMES, SHOWN_BUSES = 5, 8
"""A sentence names at most so many loads, or buses of a section; a note on renamed buses names at most so many."""

MOST_UNFED = 0.5
"""Part of a feeder's load that may be without a path to the source; more of it is a mistake in the file."""

GROUND: Node = ("", "")


class FeederImport:
    """Collects the rows, notes and problems of a feeder that another program has read.

    Buses, and nodes in all rows, have the names that `name_buses` gives them. `places` has the file and line of each
    element and of each "bus NAME"; `V` the other program's voltages (V), empty where there is nothing to compare with;
    `added` the buses that the other program does not have, and the bus before each.
    """

    def __init__(self, file: str) -> None:
        self.file = file
        self.name = ""
        self.f_nom = F_NOM
        self.places: dict[str, str] = {}
        self.problems: list[str] = []
        self.notes: list[str] = []
        self.buses: dict[str, tuple[float, float, float]] = {}  # nominal voltage (V, line-to-neutral), coordinates
        self.added: dict[str, str] = {}
        self.elements: list[LinearElement] = []
        self.switches: list[Switch] = []
        self.load_parts: list[LoadPart] = []
        self.source: Source | None = None
        self.V: dict[Node, complex] = {}

    def refuse(self, subject: str, text: str, *, named: str = "") -> None:
        """Note a problem of an element, a "bus NAME" or a file, at its place; `named`: as the sentence names it."""
        place = self.places.get(subject) or self.places.get(subject.partition(BEHIND)[0])
        problem = f"{named or subject}: {text}"
        self.problems.append(f"{place}: {problem}" if place else problem)

    def refuse_class(self, name: str) -> None:
        """Refuse an element of a class that has no counterpart here."""
        remedy = f"leave it out (--leave-out {name}), and add an inverter at its bus if it generates"
        self.refuse(name, f"class {name.partition('.')[0]} has no counterpart in gridpeers; {remedy}")

    def raise_problems(self) -> None:
        if self.problems:
            raise FeederError(self.file, tuple(self.problems))

    def name_buses(self, names: Iterable[str]) -> dict[str, str]:
        """Return the name that each bus has here; notes name those with another one.

        "_" stands for what a bus's name cannot have: blanks, "~", and characters that cannot be printed. Where two
        buses would have the same name, the later one ends with "_2".
        """
        plain = {name: plain_name(name) for name in names}
        found = {name: name for name in plain if plain[name] == name}
        taken = set(found)
        for name in plain:
            if name not in found:
                new, number = plain[name], 2
                while new in taken:
                    new, number = f"{plain[name]}_{number}", number + 1
                found[name] = new
                taken.add(new)
        if renamed := [f'"{name}" is {found[name]}' for name in plain if found[name] != name]:
            self.notes.append(f"buses are renamed, as a name has no blanks: {first_of(renamed, SHOWN_BUSES)}")
            places = {f"bus {name}": f"bus {new}" for name, new in found.items()}
            self.places = {places.get(name, name): place for name, place in self.places.items()}
        return found

    def leave_out(self, names: Sequence[str], patterns: Sequence[str], example: str) -> set[str]:
        """Return the elements that patterns match; a pattern that matches none is a problem."""
        by_lower = {name.lower(): name for name in names}
        left_out: set[str] = set()
        for pattern in patterns:
            matching = fnmatch.filter(by_lower, pattern.lower())
            if not matching:
                self.refuse("leave_out", f'"{pattern}" matches no element; write Class.name, e.g. "{example}"')
            left_out.update(by_lower[name] for name in matching)
        return left_out

    def expect_frequency(self, f_nom: float | None, remedy: str) -> None:
        """Refuse a nominal frequency (Hz) other than that of the other program; `remedy` has "{:g}" in its place."""
        if f_nom is not None and f_nom != self.f_nom:
            text = f"{self.file} is solved at {self.f_nom:g} Hz, got {f_nom:g}; its reactances hold only there"
            self.refuse("f_nom", f"{text}; {remedy.format(f_nom)}, or leave f_nom out")

    def add_element(self, name: str, nodes: Sequence[Node], Y: Any) -> None:
        """Take an element over by its admittances (S), between the nodes that are not ground; equal nodes are one."""
        if np.shape(Y) != (len(nodes), len(nodes)) or not np.isfinite(Y).all():
            self.refuse(name, "has no admittance matrix of finite values; leave it out or change it")
            return
        distinct = list(dict.fromkeys(node for node in nodes if node[1]))
        if distinct:  # else all of it is grounded
            place = np.array([[node == each for each in distinct] for node in nodes], float)
            rows = (place.T @ Y @ place).tolist()
            self.elements.append(LinearElement(name=name, nodes=tuple(distinct), Y=tuple(map(tuple, rows))))

    def add_switch(self, bus: str, short: str, letters: str, *, closed: bool) -> str:
        """Put an ideal switch between a bus and what follows; return the bus behind it."""
        behind = self.add_bus(bus, short)
        self.switches.append(
            Switch(name=f"{bus}-{behind}", alias=short, from_bus=bus, to_bus=behind, phases=letters, closed=closed)
        )
        return behind

    def add_bus(self, bus: str, short: str) -> str:
        """Return a bus that the other program does not have, of the voltage and at the place of a bus."""
        behind = bus_behind(bus, plain_name(short))
        self.added[behind] = bus
        return behind

    def add_loads(self, parts: Iterable[LoadPart]) -> None:
        """Take load parts over; a power that only a lost unit explains is a problem, one for each load."""
        refused: dict[str, str] = {}
        for part in parts:
            self.load_parts.append(part)
            most = power_of("a load", part.V_nom, PART_CURRENT, 1)
            for power, unit in ((part.S.real / 1e3, "kW"), (part.S.imag / 1e3, "kvar")):
                if text := most.objection(power, unit):
                    refused.setdefault(part.name, text)
        for name, text in refused.items():
            self.refuse(name, text)

    def checked(self, program: str, remedy: str, node_name: Callable[[str], str], *, strict: bool) -> Tables:
        """Return the feeder without what nothing can feed, checked as a network; FeederError has all problems.

        `remedy` says what to do where nothing determines a voltage to ground; `node_name` names a node by its letter
        as `program` does. Voltages that are not those of `program` are a problem if `strict`, else a note.
        """
        if self.source is None:
            self.raise_problems()
        self._leave_out_unfed(node_name)
        self.raise_problems()
        feeder = self._feeder()
        from gridpeers.plant.network import Network  # a process that only reads loads no compiler of the plant's steps

        try:
            network = Network(feeder)
        except RuntimeError:  # of the factorisation
            self.refuse(self.file, f"nothing determines some bus's voltage to ground; {remedy}")
        else:  # without load, such a voltage is beyond all bounds
            far = np.flatnonzero(np.abs(network.nominal) > BEYOND * network.V_nom)
            for bus in dict.fromkeys(network.nodes[i][0] for i in far):
                self.refuse(f"bus {bus}", f"nothing determines its voltage to ground; {remedy}")
        self.raise_problems()
        if self.V:
            try:
                worst, (bus, letter) = difference(feeder, self.V)
            except ArithmeticError as error:
                self.refuse(self.file, f"{program} solves it, but our {error}")
                self.raise_problems()
            at = f"at node {node_name(letter)}, more than anywhere else"
            text = f"our power flow differs from {program}'s by {worst:.2g} pu {at}"
            if worst > MATCH and strict:
                self.refuse(f"bus {bus}", f"{text}; an element there has an effect that the import lacks")
            elif worst > MATCH:
                feeder = replace(feeder, notes=(*feeder.notes, f"bus {bus}: {text}"))
        self.raise_problems()
        return feeder

    def _feeder(self) -> Tables:
        """Return the feeder of what was collected; its buses are those to which anything is connected."""
        used = {node for row in self.elements for node in row.nodes}
        used |= {(part.bus, p) for part in self.load_parts for p in part.ends}
        used |= {(bus, p) for row in self.switches for bus in (row.from_bus, row.to_bus) for p in row.phases}
        used |= {(self.source.bus, p) for p in PHASES} if self.source else set()
        after: dict[str, list[str]] = {name: [name] for name in self.buses if name not in self.added}
        for name, like in self.added.items():
            after[like].append(name)
        buses = []
        for like, names in after.items():
            for name in names:
                V_nom, x, y = self.buses.get(name) or self.buses[like]
                if phases := "".join(letter for letter in NODES if (name, letter) in used):
                    buses.append(Bus(name=name, phases=phases, V_nom=V_nom, x=x, y=y))
        return Tables(
            name=self.name,
            load_set="main",
            buses=tuple(buses),
            switches=tuple(self.switches),
            source=self.source,
            f_nom=self.f_nom,
            elements=tuple(self.elements),
            load_parts=tuple(self.load_parts),
            notes=tuple(self.notes),
            places=self.places,
        )

    def _leave_out_unfed(self, node_name: Callable[[str], str]) -> None:
        """Leave out sections that have no path to the source, and loads through which nothing flows; notes name them.

        If they have most of the load, they are problems. So are other loads at a node to which nothing but loads leads.
        """
        feeder = self._feeder()
        assert feeder.source is not None
        source, parts = feeder.source.bus, feeder.load_parts
        supported = {node for row in feeder.elements for node, Y in zip(row.nodes, row.Y, strict=True) if any(Y)}
        supported |= {(source, letter) for letter in PHASES}
        ends = [tuple((part.bus, letter) if letter else GROUND for letter in part.ends) for part in parts]
        tied = [(one, other) for one, other in ends if other != GROUND]
        sections = by_bus(
            part
            for part in Connectivity(feeder).parts(whole=[source], tied=tied)  # all switches closed
            if (source, "A") not in part and part & supported
        )
        gone = frozenset[Node]().union(*sections)
        idle = _idle(ends, supported)
        lost = {k for k, pair in enumerate(ends) if k in idle or pair[0] in gone}
        if sum(parts[k].S.real for k in lost) > MOST_UNFED * sum(part.S.real for part in parts):
            for section in sections:
                first, named = _named(feeder, section & supported, node_name)
                text = "no path to the source, even with all switches closed; connect it, or leave its elements out"
                self.refuse(f"bus {first}", text, named=named)
            gone, lost, sections, idle = frozenset(), set(), [], set()
        self.load_parts = [part for k, part in enumerate(parts) if k not in lost]
        alone: dict[tuple[str, str], set[str]] = {}
        for part in self.load_parts:
            for letter in part.ends:
                if letter and (part.bus, letter) not in supported:
                    alone.setdefault((part.name, part.bus), set()).add(letter)
        for (name, bus), letters in alone.items():
            which = ", ".join(map(node_name, sorted(letters, key=NODES.index)))
            self.refuse(
                name,
                f"only loads are connected to node {which} of bus {bus}: its phase is missing "
                "there, or the neutral is open; connect or ground it",
            )
        for section in sections:
            load = sum(parts[k].S.real for k in lost if ends[k][0] in section)
            with_load = f", with {load / 1e3:.3g} kW of load" if load else ""
            named = _named(feeder, section, node_name)[1]
            self.notes.append(f"{named}: no path to the source; left out{with_load}")
        if names := list(dict.fromkeys(parts[k].name for k in sorted(idle))):
            self.notes.append(f"{first_of(names, SHOWN_NAMES)}: nothing else is connected to the node; left out")
        self.elements = [row for row in self.elements if not set(row.nodes) & gone]
        switches = (
            replace(row, phases="".join(p for p in row.phases if (row.from_bus, p) not in gone))
            for row in self.switches
        )
        self.switches = [row for row in switches if row.phases]


def file_of(path: str | Path) -> Path:
    """Return the absolute path of a file; FeederError if there is none."""
    path = Path(path).absolute()
    if not path.is_file():
        text = "is a folder; name the file in it" if path.is_dir() else "there is no such file"
        raise FeederError(path.name, (f"{path}: {text}",))
    return path


def number_of(letter: str) -> str:
    """Return the number of a bus's node in OpenDSS, 1 for A."""
    return str(NODES.index(letter) + 1)


def plain_name(name: str) -> str:
    return "".join(letter if letter.isprintable() and letter not in {" ", BEHIND} else "_" for letter in name)


def _idle(ends: Sequence[tuple[Node, ...]], supported: Collection[Node]) -> set[int]:
    """Return the places of the load parts through which no current can flow.

    Nodes that only loads lead to, and their loads, form groups; a group that touches one other node, or ground alone,
    has no second way for a current.
    """
    loose = dict.fromkeys(node for pair in ends for node in pair if node != GROUND and node not in supported)
    groups = connected(loose, [(one, other) for one, other in ends if one in loose and other in loose])
    group_of = {node: group for group in groups for node in group}
    touched: dict[frozenset[Node], set[Node]] = {group: set() for group in groups}
    for one, other in ends:
        for node, opposite in ((one, other), (other, one)):
            if node in loose and opposite not in loose:
                touched[group_of[node]].add(opposite)
    return {
        k for k, pair in enumerate(ends) if any(node in loose and len(touched[group_of[node]]) <= 1 for node in pair)
    }


def _named(feeder: Tables, section: Collection[Node], node_name: Callable[[str], str]) -> tuple[str, str]:
    """Return the first bus of a section, and words for all of its buses."""
    nodes = [(bus.name, letter) for bus in feeder.buses for letter in bus.phases if (bus.name, letter) in section]
    buses = list(dict.fromkeys(bus for bus, _ in nodes))
    first = ", ".join(f"{bus}.{node_name(letter)}" for bus, letter in nodes if bus == buses[0])
    return buses[0], f"bus{'es' if len(buses) > 1 else ''} {first_of(buses, SHOWN_NAMES)} (first {first})"


def difference(feeder: Tables, theirs: Mapping[Node, complex]) -> tuple[float, Node]:
    """Return the largest difference (pu) between our voltages and another program's, `theirs` (V), and its node.

    ArithmeticError if our power flow has no solution.
    """
    from gridpeers.plant.network import Network, solve_power_flow

    network = Network(feeder)
    V = solve_power_flow(network, network.closed0)
    at = [k for k, node in enumerate(network.nodes) if node in theirs]
    given = np.array([theirs[network.nodes[k]] for k in at])
    # where the given voltage is far above the nominal one, the nominal one is not what the script means
    off = np.abs(V[at] - given) / np.maximum(network.V_nom[at], np.abs(given))
    worst = int(np.argmax(off))
    return float(off[worst]), network.nodes[at[worst]]


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
    name = next((cells[key] for key in ("element", "load", "alias") if cells.get(key)), "")
    name = name or f"bus {cells.get('bus', '').partition(BEHIND)[0]}"
    subject = next((each for each in places if each in (name, f"bus {name}") or each.endswith(f".{name}")), name)
    return f"{places.get(subject, script)}: {subject}: {text}"
