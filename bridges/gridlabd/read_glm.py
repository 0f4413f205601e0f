"""Read a feeder that is written for GridLAB-D.

GridLAB-D itself reads the model and solves its power flow at the first moment, or where its controls rest. Then every
branch comes over by the admittances that its solver uses, with regulators at their taps; loads come over as what they
take: constant power, current or impedance. What comes out is solved here, too, and must have GridLAB-D's voltages.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from gridpeers.bridges.gridlabd.glm_elements import SPLIT, GlmElements, letters_of, load_parts, shunt, voltages_of
from gridpeers.bridges.gridlabd.glm_text import (
    CHILD_OF_BUS,
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
    MATCH,
    bus_rows,
    checked,
    difference,
    left_out_by,
    path_problems,
    refuse_if,
    report_powers,
    with_plain_names,
)
from gridpeers.plant.equipment import Feeder, Source
from gridpeers.plant.equipment.imported_equipment import LinearElement, LoadPart
from gridpeers.plant.tables.read import FeederError
from gridpeers.wire.wording import suggestion

FAR = 1.3  # ratio of a voltage to the nominal one that is no voltage drop: line-to-line voltages are 1.7 times as high
LIVE = 0.5
"""Part of a bus's highest phase voltage below which a phase is de-energised, and has what others induce in it."""

BALANCED = 1e-7  # largest unbalance (pu) of the substation's voltage that is rounding
OBJECT = re.compile(r"\(obj=\d+;([^)]+)\)")  # an object in a message of GridLAB-D's


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
        model = solved_model(path)
    except FeederError as error:
        named = [(problem, OBJECT.search(problem)) for problem in error.problems]
        places = [text.place(match[1]) if match else "" for _, match in named]
        refuse_if(path, [f"{at}: {problem}" if at else problem for at, (problem, _) in zip(places, named, strict=True)])
        raise
    if not model["has_powerflow"]:
        refuse_if(path, [f"{path.name}: does not load GridLAB-D's powerflow; a feeder has a line module powerflow;"])
    return _GlmReader(path, text, model, leave_out).read(f_nom, switches)


class _GlmReader:
    """Makes a feeder of what GridLAB-D's solver holds of a model; its steps add to `notes` and `problems`."""

    def __init__(self, path: Path, text: GlmText, model: dict[str, Any], leave_out: Sequence[str]) -> None:
        self._path, self._model = path, model
        self._problems: list[str] = []
        self._notes: list[str] = []
        self._classes = {row["name"]: row["class"] for row in model["objects"]}
        self._parents = {row["name"]: row["parent"] for row in model["objects"]}
        self._buses = {bus["name"]: bus for bus in model["buses"]}
        places = {name: text.place(name) for name in self._classes}
        self._places = {each: at for n, at in places.items() if at for each in (self._called(n), f"bus {n}")}
        called = [self._called(name) for name in self._classes]
        left_out = left_out_by(called, leave_out, self._problems, "house.h1")
        self._left_out = {name for name in self._classes if self._called(name) in left_out}

    def _called(self, name: str) -> str:
        return f"{self._classes[name]}.{name}"

    def read(self, f_nom: float | None, switches: Sequence[str]) -> Feeder:
        model, problems = self._model, self._problems
        if f_nom is not None and f_nom != model["f_nom"]:
            problems.append(
                f"f_nom: the model is solved at {model['f_nom']:g} Hz, got {f_nom:g}; its reactances hold there alone; "
                f"write nominal_frequency {f_nom:g}; in its module powerflow, or leave f_nom out"
            )
        self._judge_classes()
        self._note_settling()
        if not self._mend_nominal_voltages():
            refuse_if(self._path, problems, self._places)  # all that follows is per unit
        elements = GlmElements(model["buses"], switches, problems)
        for branch in model["branches"]:
            if branch["name"] not in self._left_out and branch["class"] in LINEAR | SWITCHES:
                elements.add(branch)
        lines = [name for name, kind in self._classes.items() if kind in LINES]
        for name in sorted(set(switches) - elements.used):
            hint = suggestion(name.rpartition(".")[2], lines, "lines")
            problems.append(f'switches: there is no line "{name}"; {hint}')
        shunts, parts = self._loads()
        report_powers(parts, problems)
        lost = [(bus, p) for bus, each in self._buses.items() for p, V in voltages_of(each).items() if not _finite(V)]
        if lost and not problems:
            (bus, letter), more = lost[0], f", and so at {len(lost) - 1} nodes more" if len(lost) > 1 else ""
            problems.append(
                f"{self._called(bus)}: GridLAB-D found no solution: it has no voltage in phase {letter}{more}; "
                "look for a value that is no number, or an impedance of 0, there or before it"
            )
        refuse_if(self._path, problems, self._places)
        source = self._source(elements)
        if source is None:
            refuse_if(self._path, problems, self._places)
        assert source is not None
        rows = [*elements.rows, *shunts]
        at = {row["name"]: row["place"] for row in model["objects"]}
        places = {name: (bus["V_nom"], *at[name]) for name, bus in self._buses.items()}
        feeder = Feeder(
            name=self._path.stem,
            load_set="main",
            buses=bus_rows(places, elements.added, rows, elements.switches, parts, source),
            switches=tuple(elements.switches),
            source=source,
            f_nom=model["f_nom"],
            elements=tuple(rows),
            load_parts=tuple(parts),
            notes=tuple(self._notes),
            places=self._places,
        )
        feeder = checked(self._path, feeder, problems, "ground a winding", str)
        if all(self._classes[name] == "player" for name in self._left_out):
            self._compare(feeder)
        refuse_if(self._path, problems, self._places)
        return with_plain_names(feeder, elements.added)

    def _judge_classes(self) -> None:
        known = DATA | WATCHING | LINEAR | SWITCHES | set(CHILD_OF_BUS)
        for name, kind in self._classes.items():
            if name in self._left_out:
                continue
            called = self._called(name)
            hint = f'leave it out (leave_out=["{called}"])'
            if kind in GENERATION:
                self._problems.append(f"{called}: class {kind} is not taken over; {hint} or put an inverter there")
            elif kind == "player":
                self._problems.append(f"{called}: what a player changes in time is not taken over; {hint}")
            elif kind == "volt_var_control":
                self._notes.append(f"{called}: what it controls stays as it is")
            elif kind == "fuse":
                self._notes.append(f"{called}: stays as it is")
            elif kind not in known:
                self._problems.append(f"{called}: objects of class {kind} are not supported; {hint}")

    def _note_settling(self) -> None:
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
            if positions != (before := settling["first"][name]):
                then = f"{', '.join(positions)} in A, B, C, and {', '.join(before)} at the first moment"
                self._notes.append(f"{self._called(name)}: {then}")

    def _mend_nominal_voltages(self) -> bool:
        """Take the voltage that a bus has for its nominal one, where the model states another one by mistake.

        Return whether each bus has one then.
        """
        mended = True
        for name, bus in self._buses.items():
            V = [abs(V) for V in voltages_of(bus).values() if _finite(V)]
            live = [each for each in V if each > LIVE * max(V)]
            usual, stated = float(sum(live) / max(len(live), 1)), bus["V_nom"]
            if not stated > 0.0 and not usual > 0.0:
                mended = False
                self._problems.append(f"{self._called(name)}: nominal_voltage must be above 0 V, got {stated:g} V")
            elif usual and not (stated > 0.0 and 1.0 / FAR < usual / stated < FAR):
                self._notes.append(
                    f"{self._called(name)}: nominal_voltage {stated:g} V, and {usual:.0f} V in the power flow; the "
                    "latter is taken"
                )
                bus["V_nom"] = usual
        return mended

    def _loads(self) -> tuple[list[LinearElement], list[LoadPart]]:
        at_bus: dict[str, list[str]] = {bus: [] for bus in self._buses}
        for name in self._model["takes"]:
            if bus := self._bus_of(name):
                at_bus[bus].append(name)
        passive = {"player", *WATCHING, *CHILD_OF_BUS}
        feeding = {self._parents[name] for name in self._left_out if self._classes[name] not in passive}
        tainted = feeding | {self._bus_of(name) for name in feeding}
        shunts: list[LinearElement] = []
        parts: list[LoadPart] = []
        for bus, names in at_bus.items():
            for name in names:
                takes, called = self._model["takes"][name], self._called(name)
                if not takes or name in self._left_out:
                    continue
                if name in tainted:
                    self._notes.append(
                        f"{called}: what it takes itself is not taken over; GridLAB-D adds to it what is left out"
                    )
                elif self._classes[name] == "capacitor":
                    shunts.append(shunt(called, bus, takes))
                else:
                    parts += load_parts(called, self._buses[bus], takes)
        return shunts, parts

    def _bus_of(self, name: str) -> str:
        """Return the bus of the solver that an object is connected to, itself or one it is a child of, or ""."""
        while name and name not in self._buses:
            name = self._parents.get(name, "")
        return name

    def _source(self, elements: GlmElements) -> Source | None:
        # a SWING_PQ takes over only where no SWING is
        given = [n for n, bus in self._buses.items() if bus["type"] == SWING and n not in self._left_out]
        second = [n for n, bus in self._buses.items() if bus["type"] == PV or n in given[1:]]
        self._problems += [f"{self._called(name)}: a second source; make its bustype PQ" for name in second]
        if not given:
            self._problems.append("no bus with bustype SWING: a feeder has one, its substation")
            return None
        name, bus = given[0], self._buses[given[0]]
        if letters_of(bus["phases"]) != "ABC" or bus["phases"] & SPLIT:
            self._problems.append(f"{self._called(name)}: a source has phases A, B and C")
            return None
        V = bus["V"] / bus["V_nom"]
        balanced = np.exp(-2j * np.pi / 3.0 * np.arange(3))
        forward = complex(V @ balanced.conj()) / 3.0
        stiff = name
        if np.abs(V - forward * balanced).max() > BALANCED and abs(forward):
            stiff = elements.add_unbalanced(name, V / (forward * balanced))
            self._notes.append(f"{self._called(name)}: its voltages are unbalanced; a balanced source feeds it")
        return Source(bus=stiff, V_pu=abs(forward), angle=float(np.angle(forward)))

    def _compare(self, feeder: Feeder) -> None:
        """Note a problem if our power flow does not have GridLAB-D's voltages: something acts that we do not know."""
        theirs = {(name, p): V for name, bus in self._buses.items() for p, V in voltages_of(bus).items()}
        try:
            worst, (bus, phase) = difference(feeder, theirs)
        except ArithmeticError as error:
            self._problems.append(f"{self._path.name}: {error}")
            return
        if worst > MATCH:
            self._problems.append(
                f"bus {bus}: our power flow differs from GridLAB-D's by {worst:.2g} pu in phase {phase}, more than "
                "anywhere else; something there acts that is not taken over"
            )


def _finite(V: complex) -> bool:
    return isfinite(abs(V))
