"""Loads and capacitors of a model for GridLAB-D: what each object takes, as parts of loads and shunt elements."""

from __future__ import annotations

import cmath
from collections.abc import Mapping
from math import pi, sqrt
from typing import Any

import numpy as np

from gridpeers.plant.equipment.imported_equipment import LinearElement, LoadPart, cut_off

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
    """Power, current and admittance that the objects at one bus of the solver take.

    Parameters
    ----------
    bus : dict
        The bus.
    objects : list of dict
        The objects connected there, the bus's own among them, with what each takes.

    Attributes
    ----------
    of : dict
        Power, current and admittance of each object, by class and name.
    """

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
