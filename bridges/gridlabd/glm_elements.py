"""Branches and loads of GridLAB-D's solver, as primitive admittances between nodes of ours, switches and load parts."""

from __future__ import annotations

import cmath
from collections.abc import Collection, Mapping
from math import pi, sqrt
from typing import Any

import numpy as np

from gridpeers.bridges.feeder_import import FeederImport
from gridpeers.bridges.gridlabd.glm_text import SWITCHES
from gridpeers.plant.equipment.connectivity import Node
from gridpeers.plant.equipment.imported_equipment import LoadPart, cut_off

Matrix = np.ndarray[Any, np.dtype[np.complex128]]

LETTERS = "ABC"
SPLIT = 0x80  # bit of the solver's `phases`: split-phase
STIFF = 1e7  # admittance (S) between the substation's unbalanced voltages and the balanced ones that they are made of


def letters_of(phases: int) -> str:
    """Return the letters of a bus's nodes; the legs 1 and 2 of a split-phase service are A and B.

    >>> letters_of(0x05), letters_of(0x84)
    ('AC', 'AB')
    """
    return "AB" if phases & SPLIT else "".join(letter for k, letter in enumerate(LETTERS) if phases & (4 >> k))


def voltages_of(bus: Mapping[str, Any]) -> dict[str, complex]:
    """Return GridLAB-D's voltages (V) by node; that of leg 2 of a split-phase service is from the neutral to the leg.

    >>> voltages_of({"phases": 0x82, "V": [120.0, 119.0, 0.0]})
    {'A': 120.0, 'B': -119.0}
    """
    V = dict(zip(LETTERS, bus["V"], strict=True))
    return {p: -V[p] if bus["phases"] & SPLIT and p == "B" else V[p] for p in letters_of(bus["phases"])}


class GlmBranches:
    """Takes the branches of a model over; lines in `wanted` become switches, by name or as `class.name`.

    `used` are the wanted lines that were met.
    """

    def __init__(self, found: FeederImport, buses: list[dict[str, Any]], wanted: Collection[str]) -> None:
        self._found, self._buses, self._wanted = found, buses, set(wanted)
        self.used: set[str] = set()

    def add(self, branch: dict[str, Any]) -> None:
        kind, name = branch["class"], f"{branch['class']}.{branch['name']}"
        closed = "" if branch["open"] else "".join(p for k, p in enumerate(LETTERS) if branch["Y_from"][k, k])
        wanted = {name, branch["name"]} & self._wanted
        if kind in SWITCHES:
            letters = letters_of(branch["phases"])
            # one switch for each phase where their states differ
            for each in [letters] if len({letter in closed for letter in letters}) == 1 else letters:
                suffix = "" if each == letters else f".{each}"
                self._add(branch, _diagonal(branch, each), each, closed=each[0] in closed, suffix=suffix)
        elif kind == "fuse":
            self._add(branch, _diagonal(branch, closed))
        elif branch["open"]:
            self._found.refuse(name, f"has status OPEN; leave it out (--leave-out {name}), or make it a switch")
        elif wanted:
            self.used |= wanted
            self._add(branch, self._matrix(branch), self._letters(branch, "from"), closed=True)
        else:
            self._add(branch, self._matrix(branch))

    def add_unbalanced(self, bus: str, ratios: Matrix) -> str:
        """Put a bus of balanced voltages before one of unbalanced voltages; return its name.

        Between them is an ideal transformer for each phase: what stands against it is next to no impedance.
        """
        stiff = self._found.add_bus(bus, "swing")
        Y = STIFF * np.block([[np.diag(abs(ratios) ** 2), np.diag(-ratios.conj())], [np.diag(-ratios), np.eye(3)]])
        self._found.add_element(f"swing.{bus}", [(name, p) for name in (stiff, bus) for p in LETTERS], Y)
        return stiff

    def _add(
        self, branch: dict[str, Any], Y: Matrix, switched: str = "", *, closed: bool = True, suffix: str = ""
    ) -> None:
        """Keep an element between the nodes that it connects, behind an ideal switch of the phases `switched`."""
        start, end = (self._buses[branch[end]]["bus"] for end in ("from", "to"))
        if switched:
            start = self._found.add_switch(start, branch["name"] + suffix, switched, closed=closed)
        nodes = [(bus, letter) for bus in (start, end) for letter in LETTERS]
        own = [letter in self._letters(branch, end) for end in ("from", "to") for letter in LETTERS]
        at = [k for k, there in enumerate(own) if there and (Y[k].any() or Y[:, k].any())]
        if at:
            name = f"{branch['class']}.{branch['name']}{suffix}"
            self._found.add_element(name, [nodes[k] for k in at], Y[np.ix_(at, at)])

    def _letters(self, branch: dict[str, Any], end: str) -> str:
        phases, of_bus = branch["phases"], self._buses[branch[end]]["phases"]
        return "AB" if of_bus & SPLIT else letters_of(phases & ~SPLIT & of_bus)

    def _matrix(self, branch: dict[str, Any]) -> Matrix:
        """Return the admittances between the six nodes of a branch.

        The solver writes the voltage of leg 2 of a split-phase service from the neutral to the leg, and the equations
        of a centre-tapped transformer's secondary for the current into it: both are turned round here.
        """
        ends = [bool(self._buses[branch[end]]["phases"] & SPLIT) for end in ("from", "to")]
        first, second = (np.diag([1.0, -1.0, 0.0]) if split else np.eye(3) for split in ends)
        sign = -1.0 if ends == [False, True] else 1.0  # the transformer itself
        return np.block(
            [
                [branch["YS_from"] @ first, -branch["Y_from"] @ second],
                [-sign * branch["Y_to"] @ first, sign * branch["YS_to"] @ second],
            ]
        )


def _diagonal(branch: dict[str, Any], letters: str) -> Matrix:
    """Return the matrix of a switch or a fuse in each of some phases: as one that conducts, or as it would be."""
    conducting = [y for y in branch["Y_from"].diagonal() if y]
    y = conducting[0] if conducting else 1.0 / branch["Z"]
    own = np.diag([y if letter in letters else 0.0 for letter in LETTERS])
    return np.block([[own, -own], [-own, own]])


ANGLES = {"A": 0.0, "B": -2 * pi / 3, "C": 2 * pi / 3, "AB": pi / 6, "BC": -pi / 2, "CA": 5 * pi / 6}
"""Nominal angle (rad) of the voltage across a branch, to which GridLAB-D refers constant currents."""

LEGS = {"1": ("A", ""), "2": ("B", ""), "12": ("A", "B")}  # ends of the branches of a split-phase service
EXPONENT = {"P": 0.0, "I": 1.0, "Y": 2.0}
"""Exponent of the voltage in the power of each part: constant power, current, admittance."""

V_MIN, V_LOW = 0.7, 0.5
"""Part of its usual voltage below which a load of constant power or current takes less, and below which it is an
impedance. GridLAB-D has no such limit in a power flow; where it converts loads to impedances, it does so below 0.7 pu.
Without a limit, a dip at the islanding would be a collapse."""


def load_parts(name: str, bus: Mapping[str, Any], takes: Mapping[tuple[str, str], complex]) -> list[LoadPart]:
    """Return the parts of a load at a bus of the solver, from its power (VA), current (A) and admittance (S)."""
    found = []
    for branch in dict.fromkeys(branch for _, branch in takes):
        V_nom = bus["V_nom"] * (2.0 if branch == "12" else sqrt(3.0) if len(branch) > 1 else 1.0)
        if branch in LEGS:
            V = bus["V"][0] + bus["V"][1] if branch == "12" else bus["V"][int(branch) - 1]
            # GridLAB-D has already turned constant currents to the voltage of the solution
            direction = V / abs(V) if V else 1.0 + 0j
        else:
            V = bus["V"][LETTERS.index(branch[0])] - (bus["V"][LETTERS.index(branch[1])] if len(branch) > 1 else 0.0)
            direction = cmath.rect(1.0, ANGLES[branch])
        usual = min(1.0, abs(V) / V_nom) or 1.0
        for kind in (kind for kind in EXPONENT if (kind, branch) in takes):
            value = complex(takes[kind, branch])
            S = {"P": value, "I": V_nom * direction * value.conjugate(), "Y": V_nom * V_nom * value.conjugate()}[kind]
            found.append(
                LoadPart(
                    name=name,
                    bus=bus["bus"],
                    ends=LEGS.get(branch) or (branch[0], branch[1:]),
                    S=complex(S),
                    V_nom=V_nom,
                    exponents=(EXPONENT[kind], EXPONENT[kind]),
                    V_low=0.0 if kind == "Y" else V_LOW * usual,
                    V_min=0.0 if kind == "Y" else V_MIN * usual,
                    edge=1.0 if kind == "I" else 0.0,
                    V_off_above=cut_off(float(abs(V)) / V_nom) if S.real < 0.0 else 0.0,
                )
            )
    return found


def shunt(bus: str, takes: Mapping[tuple[str, str], complex]) -> tuple[list[Node], Matrix]:
    """Return the nodes and the admittances of a capacitor, from those of its branches."""
    ends = {branch: LEGS.get(branch) or (branch[0], branch[1:]) for _, branch in takes}
    letters = sorted({letter for pair in ends.values() for letter in pair if letter})
    Y = np.zeros((len(letters), len(letters)), complex)
    for (_, branch), y in takes.items():
        across = np.array([(letter == ends[branch][0]) - (letter == ends[branch][1]) * 1.0 for letter in letters])
        Y += y * np.outer(across, across)
    return [(bus, letter) for letter in letters], Y
