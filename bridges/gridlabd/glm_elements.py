"""Branches of GridLAB-D's solver, as primitive admittances between nodes of ours, and switches."""

from __future__ import annotations

import cmath
from collections.abc import Collection, Mapping, Sequence
from math import pi, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridpeers.bridges.gridlabd.glm_text import SWITCHES
from gridpeers.plant.equipment import Bus, Switch
from gridpeers.plant.equipment.imported_equipment import LinearElement, LoadPart, bus_behind, cut_off

Complex = NDArray[np.complex128]

LETTERS = "ABC"
SPLIT = 0x80
"""Bit of the solver's `phases`: split-phase."""

STIFF = 1e7
"""Admittance (S) between the substation's unbalanced voltages and the balanced ones that they are made of."""


def letters_of(phases: int) -> str:
    """Return the letters of a bus's nodes; the legs 1 and 2 of a split-phase service are A and B.

    Examples
    --------
    >>> letters_of(0x05), letters_of(0x84)
    ('AC', 'AB')
    """
    if phases & SPLIT:
        return "AB"
    return "".join(letter for k, letter in enumerate(LETTERS) if phases & (4 >> k))


class GlmElements:
    """Collects the linear elements (`rows`) and switches of a model; notes in `problems` what cannot be represented.

    `wanted_switches` are lines to make switches, by name or as `class.name`; `used_switches` those that were met.
    """

    def __init__(self, buses: list[dict[str, Any]], wanted_switches: Collection[str], problems: list[str]) -> None:
        self._buses, self._wanted, self._problems = buses, set(wanted_switches), problems
        self.rows: list[LinearElement] = []
        self.switches: list[Switch] = []
        self.used_switches: set[str] = set()
        self.added: dict[str, tuple[int, str]] = {}
        """Buses behind switches: the place of the bus before them, and their phases."""

    def add(self, branch: dict[str, Any], where: str) -> None:
        """Take a branch over; `where` begins its problems."""
        name = f"{branch['class']}.{branch['name']}"
        wanted = {name, branch["name"]} & self._wanted
        if branch["class"] in SWITCHES:
            self._add_switch(name, branch)
        elif branch["class"] == "fuse":
            self._append(name, branch, _blocks(branch, _conducting(branch), _closed(branch)))
        elif branch["open"]:
            self._problems.append(f'{where}: status OPEN; leave it out (leave_out=["{name}"]), or put a switch there')
        elif wanted:
            self.used_switches |= wanted
            self._add_before(name, branch, self._letters(branch, "from"), closed=True)
        else:
            self._append(name, branch, self._matrix(branch))

    def add_unbalanced(self, at: int, ratios: Sequence[complex]) -> str:
        """Put a bus of balanced voltages before one of unbalanced voltages; return its name.

        Between them is an ideal transformer for each phase: what stands against it is next to no impedance.
        """
        bus = self._buses[at]["name"]
        stiff = bus_behind(bus, "swing")
        self.added[stiff] = at, LETTERS
        r = np.array(ratios)
        blocks = STIFF * np.block([[np.diag(abs(r) ** 2), np.diag(-r.conj())], [np.diag(-r), np.eye(3)]])
        nodes = tuple((name, letter) for name in (stiff, bus) for letter in LETTERS)
        rows = tuple(tuple(complex(value) for value in row) for row in blocks)
        self.rows.append(LinearElement(name=f"swing.{bus}", nodes=nodes, Y=rows))
        return stiff

    def behind(self) -> dict[str, str]:
        """Return the buses that are not in the model, and the bus before each."""
        return {name: str(self._buses[at]["name"]) for name, (at, _) in self.added.items()}

    def bus_rows(self, used: set[str], places: dict[str, tuple[float, float]]) -> tuple[Bus, ...]:
        """Return the buses in the solver's order, each with those that switches have behind it."""
        behind: dict[int, list[tuple[str, str]]] = {}
        for name, (at, letters) in self.added.items():
            behind.setdefault(at, []).append((name, letters))
        found = []
        for at, bus in enumerate(self._buses):
            x, y = places.get(bus["name"], (0.0, 0.0))
            own = [(bus["name"], letters_of(bus["phases"]))] if bus["name"] in used else []
            found += [
                Bus(name=name, phases=letters, V_nom=bus["V_nom"], x=x, y=y)
                for name, letters in [*own, *behind.get(at, ())]
            ]
        return tuple(found)

    def _add_switch(self, name: str, branch: dict[str, Any]) -> None:
        """Put ideal switches before a switch's impedance: one, or one a phase where their states differ."""
        letters, closed = letters_of(branch["phases"]), _closed(branch)
        states = {letter in closed for letter in letters}
        for group in (letters,) if len(states) == 1 else tuple(letters):
            self._add_before(name, branch, group, closed=group[0] in closed, alone=len(states) == 1)

    def _add_before(self, name: str, branch: dict[str, Any], letters: str, *, closed: bool, alone: bool = True) -> None:
        """Put an ideal switch before a branch, or before one of its phases."""
        bus, short = self._buses[branch["from"]]["name"], branch["name"] if alone else f"{branch['name']}.{letters}"
        behind = bus_behind(bus, short)
        self.added[behind] = branch["from"], letters
        blocks = _blocks(branch, _conducting(branch), letters) if branch["class"] in SWITCHES else self._matrix(branch)
        self._append(name if alone else f"{name}.{letters}", branch, blocks, behind)
        self.switches.append(
            Switch(name=f"{bus}-{behind}", alias=short, from_bus=bus, to_bus=behind, phases=letters, closed=closed)
        )

    def _letters(self, branch: dict[str, Any], end: str) -> str:
        both = branch["phases"], self._buses[branch[end]]["phases"]
        return "AB" if both[1] & SPLIT else letters_of(both[0] & ~SPLIT & both[1])

    def _matrix(self, branch: dict[str, Any]) -> Complex:
        """Return the admittances between the six nodes of a branch.

        The solver writes the voltage of leg 2 of a split-phase service from the neutral to the leg, and the equations
        of a centre-tapped transformer's secondary for the current into it: both are turned round here.
        """
        Y_from, Y_to, YS_from, YS_to = (
            np.array([complex(*pair) for pair in branch[key]]).reshape(3, 3)
            for key in ("Y_from", "Y_to", "YS_from", "YS_to")
        )
        ends = [bool(self._buses[branch[end]]["phases"] & SPLIT) for end in ("from", "to")]
        first, second = (np.diag([1.0, -1.0, 0.0]) if split else np.eye(3) for split in ends)
        if ends == [False, True]:  # the transformer itself
            return np.block([[YS_from @ first, -Y_from @ second], [Y_to @ first, -YS_to @ second]])
        return np.block([[YS_from @ first, -Y_from @ second], [-Y_to @ first, YS_to @ second]])

    def _append(self, name: str, branch: dict[str, Any], blocks: Complex, start: str = "") -> None:
        """Keep an element between the nodes that it really connects."""
        buses = start or self._buses[branch["from"]]["name"], self._buses[branch["to"]]["name"]
        nodes = [(bus, letter) for bus in buses for letter in LETTERS]
        present = [
            letter in self._letters(branch, end) and bool(blocks[k].any() or blocks[:, k].any())
            for k, (end, letter) in enumerate((end, letter) for end in ("from", "to") for letter in LETTERS)
        ]
        at = np.flatnonzero(present)
        if not np.isfinite(blocks).all():
            self._problems.append(f"{name}: GridLAB-D gives no admittance for it; leave it out or change it")
        elif len(at):
            rows = tuple(tuple(complex(value) for value in row) for row in blocks[np.ix_(at, at)])
            self.rows.append(LinearElement(name=name, nodes=tuple(nodes[k] for k in at), Y=rows))


def _closed(branch: dict[str, Any]) -> str:
    """Return the phases in which a switch or a fuse conducts: those with an admittance."""
    if branch["open"]:
        return ""
    return "".join(letter for k, letter in enumerate(LETTERS) if any(branch["Y_from"][4 * k]))


def _conducting(branch: dict[str, Any]) -> complex:
    """Return the admittance (S) of a switch's or a fuse's phase that conducts: as it is, or as it would be."""
    for k in range(3):
        if any(branch["Y_from"][4 * k]):
            return complex(*branch["Y_from"][4 * k])
    R, X = branch["Z"]
    return complex(1.0 / R, 1.0 / R) if branch["class"] == "fuse" else 1.0 / complex(R, X)


def _blocks(branch: dict[str, Any], y: complex, letters: str) -> Complex:
    """Return the matrix of an admittance in each of some phases."""
    own = np.diag([y if letter in letters else 0.0 for letter in LETTERS])
    return np.block([[own, -own], [-own, own]])


Taken = dict[str, dict[str, complex]]
"""By branch of a load ("A", "BC", "12"): constant power `P` (VA), current as power at nominal voltage `I` (VA), `Y`."""

ANGLES = {"A": 0.0, "B": -2 * pi / 3, "C": 2 * pi / 3, "AB": pi / 6, "BC": -pi / 2, "CA": 5 * pi / 6}
"""Nominal angle (rad) of the voltage across a branch, to which GridLAB-D refers constant currents."""

LEGS = {"1": ("A", ""), "2": ("B", ""), "12": ("A", "B")}
"""Ends of the branches of a split-phase service."""

EXPONENT = {"P": 0.0, "I": 1.0, "Y": 2.0}
"""Exponent of the voltage in the power of each part: constant power, current, admittance."""

EDGE = {"P": 0.0, "I": 1.0, "Y": 0.0}
"""Exponent by which the current of each part meets its limit (`LoadPart.edge`)."""

V_MIN, V_LOW = 0.7, 0.5
"""Part of its usual voltage below which a load of constant power or current takes less, and below which it is an
impedance. GridLAB-D has no such limit in a power flow; where it converts loads to impedances, it does so below 0.7 pu.
Without a limit, a dip at the islanding would be a collapse."""


class BusLoads:
    """Power, current and admittance that each object at one bus of the solver takes: `of`, by class and name."""

    def __init__(self, bus: Mapping[str, Any], objects: list[dict[str, Any]]) -> None:
        self._bus = bus
        self._V = [complex(*pair) for pair in bus["V"]]
        self.of = {(row["class"], row["name"]): self._taken(row["takes"]) for row in objects}
        for row in objects:
            if row["class"] == "capacitor" and row["connected_delta"]:
                self.of[row["class"], row["name"]] = _delta_bank(row)

    def parts(self, name: str, taken: Taken) -> list[LoadPart]:
        """Return the parts of a load that takes this."""
        found = []
        for branch, kinds in taken.items():
            V = self._V_nom(branch)
            across = abs(self._across(branch)) / V
            usual = min(1.0, across) or 1.0
            for kind, value in kinds.items():
                S = V * V * value.conjugate() if kind == "Y" else value
                low, least = (0.0, 0.0) if kind == "Y" else (V_LOW * usual, V_MIN * usual)
                found.append(
                    LoadPart(
                        name=name,
                        bus=self._bus["name"],
                        ends=LEGS.get(branch) or (branch[0], branch[1:]),
                        S=S,
                        V_nom=V,
                        exponents=(EXPONENT[kind], EXPONENT[kind]),
                        V_low=low,
                        V_min=least,
                        edge=EDGE[kind],
                        V_off_above=cut_off(across) if S.real < 0.0 else 0.0,
                    )
                )
        return found

    def shunt(self, name: str, taken: Taken) -> LinearElement | None:
        """Return a capacitor that takes this, as an element; None if it is switched off."""
        ends = {branch: LEGS.get(branch) or (branch[0], branch[1:]) for branch in taken}
        letters = sorted({letter for pair in ends.values() for letter in pair if letter})
        if not letters:
            return None
        Y = np.zeros((len(letters), len(letters)), complex)
        for branch, kinds in taken.items():
            across = np.array([(letter == ends[branch][0]) - (letter == ends[branch][1]) * 1.0 for letter in letters])
            Y += kinds.get("Y", 0j) * np.outer(across, across)
        rows = tuple(tuple(complex(value) for value in row) for row in Y)
        return LinearElement(name=name, nodes=tuple((self._bus["name"], letter) for letter in letters), Y=rows)

    def _taken(self, takes: Mapping[str, Mapping[str, list[list[float]]]]) -> Taken:
        found: Taken = {}
        for kind, branches in takes.items():
            for branch, pairs in branches.items():
                value = sum((complex(*pair) for pair in pairs), start=0j)
                if kind == "I":
                    value = self._V_nom(branch) * self._direction(branch) * value.conjugate()
                found.setdefault(branch, {})[kind] = value
        return found

    def _V_nom(self, branch: str) -> float:
        V = float(self._bus["V_nom"])
        if branch in LEGS:
            return 2.0 * V if branch == "12" else V
        return V * sqrt(3.0) if len(branch) > 1 else V

    def _direction(self, branch: str) -> complex:
        """Return the direction of the voltage to which a constant current refers.

        For a split-phase service it is that of the solution, as GridLAB-D has already turned the currents there.
        """
        if branch not in LEGS:
            return cmath.rect(1.0, ANGLES[branch])
        V = self._across(branch)
        return V / abs(V) if V else 1.0 + 0j

    def _across(self, branch: str) -> complex:
        """Return GridLAB-D's voltage across a branch (V); leg 2 of a split-phase service counts from the neutral."""
        if branch in LEGS:
            return self._V[0] + self._V[1] if branch == "12" else self._V[int(branch) - 1]
        ends = [self._V["ABC".index(letter)] for letter in branch]
        return ends[0] - ends[1] if len(ends) > 1 else ends[0]


def _delta_bank(row: Mapping[str, Any]) -> Taken:
    """Return a delta capacitor at a bus of the other connection, for which GridLAB-D makes up admittances to ground."""
    found: Taken = {}
    for k, branch in enumerate(("AB", "BC", "CA")):
        if row["closed"][k] and row["connected"] & (1, 2, 4)[k] and row["var"][k]:
            found[branch] = {"Y": 1j * row["var"][k] / row["V"] ** 2}
    return found
