"""Read a feeder that is written for GridLAB-D.

GridLAB-D itself reads the model and solves its power flow at the first moment, or where its controls rest. Then every
branch comes over by the admittances that its solver uses, with regulators at their taps; loads come over as what they
take: constant power, current or impedance. What comes out is solved here, too, and must have GridLAB-D's voltages.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from gridpeers.bridges.gridlabd.glm_elements import SPLIT, BusLoads, GlmElements, letters_of
from gridpeers.bridges.gridlabd.glm_text import (
    CHILD_OF_BUS,
    CONTROLS,
    DATA,
    GENERATION,
    LINEAR,
    LINES,
    SWITCHES,
    WATCHING,
    GlmText,
)
from gridpeers.bridges.gridlabd.gridlabd_power_flow import PV, SWING
from gridpeers.bridges.gridlabd.gridlabd_process import solved_model
from gridpeers.bridges.import_checks import (
    BEYOND,
    left_out_by,
    path_problems,
    refuse_if,
    refuse_unsolvable,
    report_powers,
    with_plain_names,
    without_unfed,
)
from gridpeers.bridges.import_comparison import MATCH, difference
from gridpeers.plant.equipment import Feeder, Source
from gridpeers.plant.equipment.imported_equipment import LinearElement, LoadPart
from gridpeers.plant.tables.read import FeederError
from gridpeers.wire.wording import suggestion

FAR = 1.3
"""Ratio of a voltage to the nominal one that is no voltage drop: line-to-line voltages are 1.7 times as high."""

LIVE = 0.5
"""Part of a bus's highest phase voltage below which a phase is de-energised, and has what others induce in it."""

BALANCED = 1e-7
"""Largest unbalance (pu) of the substation's voltage that is rounding."""

OBJECT = re.compile(r"\(obj=\d+;([^)]+)\)")
"""An object in a message of GridLAB-D's."""

UNGROUNDED = "ground a winding"
"""Remedy where nothing determines a voltage to ground."""


def read_glm(
    path: str | Path, f_nom: float | None = None, *, leave_out: Sequence[str] = (), switches: Sequence[str] = ()
) -> Feeder:
    """Return the feeder of a model for GridLAB-D (`gridpeers.Feeder.from_glm`).

    Its `notes` list what was done instead of what the model says.
    """
    path = Path(path).absolute()
    refuse_if(path, path_problems(path))
    text = GlmText(path)
    refuse_if(path, text.problems)
    try:
        model = solved_model(path, text)
    except FeederError as error:
        refuse_if(path, [_placed(problem, text) for problem in error.problems])
        raise
    if not model["has_powerflow"]:
        refuse_if(path, [f"{path.name}: does not load GridLAB-D's powerflow; a feeder has a line module powerflow;"])
    return _GlmReader(path, text, model, leave_out).read(f_nom, switches)


class _GlmReader:
    """Makes a feeder of what GridLAB-D's solver holds of a model."""

    def __init__(self, path: Path, text: GlmText, model: dict[str, Any], leave_out: Sequence[str]) -> None:
        self._path, self._model = path, model
        self._problems: list[str] = []
        self._notes: list[str] = []
        self._classes = {row["name"]: row["class"] for row in model["objects"]}
        self._parents = {row["name"]: row["parent"] for row in model["objects"]}
        names = [f"{kind}.{name}" for name, kind in self._classes.items()]
        self._places = {
            each: place
            for name, kind in self._classes.items()
            if (place := text.place(name))
            for each in (f"{kind}.{name}", f"bus {name}")
        }
        left_out = left_out_by(names, leave_out, self._problems, "house.h1")
        self._left_out = {name.partition(".")[2] for name in left_out}

    def read(self, f_nom: float | None, switches: Sequence[str]) -> Feeder:
        """Return the feeder, or raise a FeederError with every problem."""
        model, problems = self._model, self._problems
        if f_nom is not None and f_nom != model["f_nom"]:
            problems.append(
                f"f_nom: the model is solved at {model['f_nom']:g} Hz, got {f_nom:g}; its reactances hold there alone; "
                f"write nominal_frequency {f_nom:g}; in its module powerflow, or leave f_nom out"
            )
        self._refuse_classes()
        self._tell_settling()
        known = len(problems)
        self._mend_nominal_voltages()
        if len(problems) > known:
            refuse_if(self._path, problems, self._places)  # all that follows is per unit
        elements = GlmElements(model["buses"], switches, problems)
        for branch in model["branches"]:
            if branch["name"] not in self._left_out and branch["class"] in LINEAR | SWITCHES:
                elements.add(branch, self._called(branch["name"]))
        for name in sorted(set(switches) - elements.used_switches):
            hint = suggestion(name.rpartition(".")[2], self._names_of(LINES), "lines")
            problems.append(f'switches: there is no line "{name}"; {hint}')
        shunts, parts = self._loads()
        report_powers(parts, problems)
        self._report_no_solution()
        refuse_if(self._path, problems, self._places)
        source = self._source(elements)
        refuse_if(self._path, problems, self._places)
        assert source is not None
        rows = [*elements.rows, *shunts]
        used = {bus for row in rows for bus, _ in row.nodes} | {part.bus for part in parts} | {source.bus}
        used |= {bus for switch in elements.switches for bus in (switch.from_bus, switch.to_bus)}
        places = {row["name"]: row["place"] for row in model["objects"] if row["place"]}
        feeder = Feeder(
            name=self._path.stem,
            load_set="main",
            buses=elements.bus_rows(used, places),
            switches=tuple(elements.switches),
            source=source,
            f_nom=model["f_nom"],
            elements=tuple(rows),
            load_parts=tuple(parts),
            places=self._places,
        )
        feeder = without_unfed(feeder, self._notes, str)
        feeder = msgspec.structs.replace(feeder, notes=tuple(self._notes))
        refuse_unsolvable(self._path, feeder, problems, UNGROUNDED, str)
        if all(self._classes[name] == "player" for name in self._left_out):
            self._compare(feeder)
        refuse_if(self._path, problems, self._places)
        return with_plain_names(feeder, elements.behind())

    def _names_of(self, classes: Collection[str]) -> list[str]:
        return [name for name, kind in self._classes.items() if kind in classes]

    def _called(self, name: str) -> str:
        return f"{self._classes[name]}.{name}"

    def _tell_settling(self) -> None:
        """Note how far GridLAB-D has gone on, and what its regulators and capacitors have done."""
        settling = self._model.get("settling")
        if not settling:
            return
        file, time = self._path.name, settling["time"]
        if not settling["solved"]:
            self._notes.append(
                f"{file}: regulators and capacitors stay as at the first moment; GridLAB-D has no solution at {time}, "
                "before they rest"
            )
            return
        if not settling["rest"]:
            self._notes.append(
                f"{file}: regulators and capacitors still move at {time}, an hour after the first moment; they stay as "
                "then"
            )
        elif settling["seconds"]:
            self._notes.append(f"{file}: as GridLAB-D has it at {time}, when its regulators and capacitors rest")
        for name, positions in settling["last"].items():
            before = settling["first"][name]
            if positions != before:
                self._notes.append(
                    f"{self._classes[name]}.{name}: {', '.join(positions)} in A, B, C, and {', '.join(before)} at the "
                    "first moment"
                )

    def _mend_nominal_voltages(self) -> None:
        """Take the voltage that a bus has for its nominal one, where the model states another one by mistake."""
        for bus in self._model["buses"]:
            V = [abs(voltage_of(bus, letter)) for letter in letters_of(bus["phases"])]
            V = [each for each in V if isfinite(each)]  # `_report_no_solution` names the others
            live = [each for each in V if each > LIVE * max(V)]
            usual = sum(live) / max(len(live), 1)
            stated = bus["V_nom"] > 0.0
            if not stated and not usual > 0.0:
                self._problems.append(
                    f"{self._called(bus['name'])}: nominal_voltage must be above 0 V, got {bus['V_nom']:g} V"
                )
            elif usual and not (stated and 1.0 / FAR < usual / bus["V_nom"] < FAR):
                self._notes.append(
                    f"{bus['class']}.{bus['name']}: nominal_voltage {bus['V_nom']:g} V, and {usual:.0f} V in the power "
                    "flow; the latter is taken"
                )
                bus["V_nom"] = usual

    def _report_no_solution(self) -> None:
        """Note a problem if a voltage of GridLAB-D is no number, unless a value that is none explains it."""
        nodes = [(bus, letter) for bus in self._model["buses"] for letter in letters_of(bus["phases"])]
        lost = [(bus, letter) for bus, letter in nodes if not isfinite(abs(voltage_of(bus, letter)))]
        if lost and not self._problems:
            (bus, letter), more = lost[0], f", and so at {len(lost) - 1} nodes more" if len(lost) > 1 else ""
            self._problems.append(
                f"{self._called(bus['name'])}: GridLAB-D found no solution: it has {abs(voltage_of(bus, letter)):g} V "
                f"in phase {letter}{more}; look for a value that is no number, or an impedance of 0, there or before it"
            )

    def _refuse_classes(self) -> None:
        """Note a problem for each object that cannot be represented."""
        known = DATA | WATCHING | CONTROLS | LINEAR | SWITCHES | set(CHILD_OF_BUS)
        for name, kind in self._classes.items():
            if name in self._left_out:
                continue
            hint = f'leave it out (leave_out=["{kind}.{name}"])'
            if kind in GENERATION:
                self._problems.append(
                    f"{self._called(name)}: class {kind} is not taken over; {hint} or put an inverter there"
                )
            elif kind == "player":
                self._problems.append(f"{self._called(name)}: what a player changes in time is not taken over; {hint}")
            elif kind in CONTROLS:
                self._notes.append(f"{kind}.{name}: what it controls stays as it is")
            elif kind not in known:
                self._problems.append(f"{self._called(name)}: objects of class {kind} are not supported; {hint}")
            elif kind == "fuse":
                self._notes.append(f"{kind}.{name}: stays as it is")

    def _loads(self) -> tuple[list[LinearElement], list[LoadPart]]:
        """Return capacitors and loads, object by object."""
        at_bus: dict[str, list[dict[str, Any]]] = {bus["name"]: [] for bus in self._model["buses"]}
        for row in self._model["takes"]:
            bus = self._bus_of(row["name"], at_bus)
            if bus is not None:
                at_bus[bus].append(row)
        passive = {"player", *WATCHING, *CHILD_OF_BUS}
        feeding = {self._parents[name] for name in self._left_out if self._classes[name] not in passive}
        tainted = feeding | {bus for name in feeding if (bus := self._bus_of(name, at_bus))}
        shunts: list[LinearElement] = []
        parts: list[LoadPart] = []
        for bus in self._model["buses"]:
            loads = BusLoads(bus, at_bus[bus["name"]])
            for (kind, name), taken in loads.of.items():
                if not taken or name in self._left_out:
                    continue
                if name in tainted:
                    self._notes.append(
                        f"{kind}.{name}: what it takes itself is not taken over; GridLAB-D adds to it what is left out"
                    )
                elif kind == "capacitor":
                    shunt = loads.shunt(f"{kind}.{name}", taken)
                    shunts += [shunt] if shunt else []
                else:
                    parts += loads.parts(f"{kind}.{name}", taken)
        return shunts, parts

    def _bus_of(self, name: str, buses: dict[str, Any]) -> str | None:
        """Return the bus of the solver that an object is connected to: itself, or one it is a child of."""
        while name and name not in buses:
            name = self._parents.get(name, "")
        return name or None

    def _source(self, elements: GlmElements) -> Source | None:
        """Return the substation: the bus whose voltage is given."""
        # a SWING_PQ takes over only where no SWING is
        given = [bus for bus in self._model["buses"] if bus["type"] == SWING and bus["name"] not in self._left_out]
        for bus in self._model["buses"]:
            if bus["type"] == PV or bus in given[1:]:
                self._problems.append(f"{self._called(bus['name'])}: a second source; make its bustype PQ")
        if not given:
            self._problems.append("no bus with bustype SWING: a feeder has one, its substation")
            return None
        bus = given[0]
        if letters_of(bus["phases"]) != "ABC" or bus["phases"] & SPLIT:
            self._problems.append(f"{self._called(bus['name'])}: a source has phases A, B and C")
            return None
        V = np.array([complex(*pair) for pair in bus["V"]]) / bus["V_nom"]
        balanced = np.exp(-2j * np.pi / 3.0 * np.arange(3))
        forward = complex(V @ balanced.conj()) / 3.0
        source = Source(bus=bus["name"], V_pu=abs(forward), angle=float(np.angle(forward)))
        if np.abs(V - forward * balanced).max() <= BALANCED or not abs(forward):
            return source
        stiff = elements.add_unbalanced(self._model["buses"].index(bus), (V / (forward * balanced)).tolist())
        self._notes.append(f"{bus['class']}.{bus['name']}: its voltages are unbalanced; a balanced source feeds it")
        return Source(bus=stiff, V_pu=source.V_pu, angle=source.angle)

    def _compare(self, feeder: Feeder) -> None:
        """Note a problem if our power flow does not have GridLAB-D's voltages: something acts that we do not know."""
        V_nom = {bus.name: bus.V_nom for bus in feeder.buses}
        nodes = {(bus.name, letter) for bus in feeder.buses for letter in bus.phases}
        buses = {bus["name"]: bus for bus in self._model["buses"]}
        theirs = {(name, letter): voltage_of(buses[name], letter) for name, letter in nodes if name in buses}
        highest = max(theirs, key=lambda node: abs(theirs[node]) / V_nom[node[0]])
        if abs(theirs[highest]) > BEYOND * V_nom[highest[0]]:
            alone = [name for name in buses if name not in V_nom]
            hint = f"nothing leads to bus {', '.join(alone[:3])}" if alone else "some section has no source"
            self._problems.append(
                f"bus {highest[0]}: GridLAB-D's power flow has {abs(theirs[highest]) / V_nom[highest[0]]:.2g} pu: "
                f"{hint}; take it out of the model, or connect it"
            )
            return
        try:
            worst, (bus, phase), _ = difference(feeder, theirs)
        except ArithmeticError as error:
            self._problems.append(f"{self._path.name}: {error}")
            return
        if worst > MATCH:
            self._problems.append(
                f"bus {bus}: our power flow differs from GridLAB-D's by {worst:.2g} pu in phase {phase}, more than "
                "anywhere else; something there acts that is not taken over"
            )


def _placed(problem: str, text: GlmText) -> str:
    """Return a problem of GridLAB-D's behind the file and line of the object that it names, if they are known."""
    named = OBJECT.search(problem)
    place = text.place(named[1]) if named else ""
    return f"{place}: {problem}" if place else problem


def voltage_of(bus: dict[str, Any], letter: str) -> complex:
    """Return GridLAB-D's voltage (V) of a node; that of leg 2 of a split-phase service is from the neutral to the leg.

    Examples
    --------
    >>> voltage_of({"phases": 0x82, "V": [[120.0, 0.0], [119.0, 0.0], [0.0, 0.0]]}, "B")
    (-119-0j)
    """
    V = complex(*bus["V"]["ABC".index(letter)])
    return -V if bus["phases"] & SPLIT and letter == "B" else V
