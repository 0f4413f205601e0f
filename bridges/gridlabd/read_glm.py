"""Read a feeder that is written for GridLAB-D.

GridLAB-D itself reads the model and solves its power flow at the first moment, or where its controls rest. Then every
branch is taken over by the admittances that its solver uses, with regulators at their taps, and every load by its
constant power, current and impedance. The feeder is then solved here, too, and must have GridLAB-D's voltages.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import closing
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from gridpeers.bridges.engine_process import EngineError, EngineProcess
from gridpeers.bridges.feeder_import import FeederImport, file_of
from gridpeers.bridges.gridlabd.glm_elements import SPLIT, GlmBranches, letters_of, load_parts, shunt, voltages_of
from gridpeers.bridges.gridlabd.glm_text import CHILD_OF_BUS, DATA, LINEAR, LINES, SWITCHES, WATCHING, GlmText, messages
from gridpeers.bridges.gridlabd.gridlabd_power_flow import PV, SWING
from gridpeers.plant.equipment import Source, Tables
from gridpeers.plant.tables.read import FeederError
from gridpeers.wire.wording import printable, suggestion

FAR = 1.3  # ratio of a voltage to the nominal one that is no voltage drop: line-to-line voltages are 1.7 times as high
LIVE = 0.5
"""Part of a bus's highest phase voltage below which a phase is de-energised, and has what others induce in it."""

BALANCED = 1e-7  # largest unbalance (pu) of the substation's voltage that is rounding
OBJECT = re.compile(r"\(obj=\d+;([^)]+)\)")  # an object in a message of GridLAB-D's

NOTED = {"volt_var_control": "its elements stay as they are", "fuse": "stays as it is"}
KNOWN = DATA | WATCHING | LINEAR | SWITCHES | NOTED.keys() | set(CHILD_OF_BUS)


def read_glm(
    path: str | Path, f_nom: float | None = None, *, leave_out: Sequence[str] = (), switches: Sequence[str] = ()
) -> Tables:
    """Return the feeder of a model for GridLAB-D (`gridpeers.Feeder.read`).

    Its `notes` list every departure from the model.
    """
    path = file_of(path)
    text = GlmText(path)
    if text.problems:
        raise FeederError(path.name, tuple(text.problems))
    found = _GlmReader(path, text, solved_model(path, text), leave_out).read(f_nom, switches)
    return found.checked("GridLAB-D", "ground a winding", str, strict=True)


def solved_model(path: Path, text: GlmText) -> dict[str, Any]:
    """Return what GridLAB-D's solver holds of a model (`gridlabd_power_flow.PowerFlowModel.solve`).

    FeederError has GridLAB-D's own messages, each with its file and line.
    """
    module = "gridpeers.bridges.gridlabd.gridlabd_power_flow"
    with closing(EngineProcess(module, "gridlabd", "GridLAB-D", ".glm", "gridlabd")) as engine:
        try:
            model: dict[str, Any] = engine.read(path)
            said = "" if "buses" in model else f"{path.name}: GridLAB-D's power flow does not converge"
        except EngineError as error:
            last = printable(str(error).strip().rpartition("\n")[2])
            silent = f"GridLAB-D's process {last} and said nothing; run the model in GridLAB-D"
            model, said = {}, silent if error.ended else f"GridLAB-D: {last}"
        printed = messages(engine.printed)
    if not model.get("has_powerflow", True):
        raise FeederError(
            path.name, (f"{path.name}: does not load GridLAB-D's module powerflow; write a line module powerflow;",)
        )
    if said:
        problems = printed or [said]
        if (method := model.get("method", "NR")) != "NR":
            problems.append(
                f"{path.name}: has solver_method {method}, but is solved with NR here; try NR in GridLAB-D, too"
            )
        places = [text.place(match[1]) if (match := OBJECT.search(problem)) else "" for problem in problems]
        placed = (f"{at}: {problem}" if at else problem for at, problem in zip(places, problems, strict=True))
        raise FeederError(path.name, tuple(placed))
    return model


class _GlmReader:
    """Makes a feeder of what GridLAB-D's solver holds of a model."""

    def __init__(self, path: Path, text: GlmText, model: dict[str, Any], leave_out: Sequence[str]) -> None:
        self._model = model
        found = self._found = FeederImport(path.name)
        found.name, found.f_nom = path.stem, model["f_nom"]
        self._classes = {name: kind for name, (kind, _, _) in model["objects"].items()}
        self._parents = {name: parent for name, (_, parent, _) in model["objects"].items()}
        self._buses = {bus["name"]: bus for bus in model["buses"]}
        places = {name: text.place(name) for name in self._classes}
        found.places = {each: at for n, at in places.items() if at for each in (self._called(n), f"bus {n}")}
        for name, bus_name in found.name_buses(self._buses).items():
            self._buses[name]["bus"] = bus_name
        called = {self._called(name): name for name in self._classes}
        self._left_out = {called[each] for each in found.leave_out(list(called), leave_out, "house.h1")}

    def _called(self, name: str) -> str:
        return f"{self._classes[name]}.{name}"

    def read(self, f_nom: float | None, switches: Sequence[str]) -> FeederImport:
        found, model = self._found, self._model
        found.expect_frequency(f_nom, "write nominal_frequency {:g}; in its module powerflow")
        self._judge_classes()
        self._note_settling()
        if not self._mend_nominal_voltages():
            found.raise_problems()  # all that follows is per unit
        branches = GlmBranches(found, model["buses"], switches)
        for branch in model["branches"]:
            if branch["name"] not in self._left_out and branch["class"] in LINEAR | SWITCHES:
                branches.add(branch)
        lines = [name for name, kind in self._classes.items() if kind in LINES]
        for name in sorted(set(switches) - branches.used):
            hint = suggestion(name.rpartition(".")[2], lines, "lines")
            found.refuse("switches", f'there is no line "{name}"; {hint}')
        self._add_loads()
        V = {(bus, p): V for bus, each in self._buses.items() for p, V in voltages_of(each).items()}
        if (lost := [node for node, each in V.items() if not isfinite(abs(each))]) and not found.problems:
            (bus, letter), more = lost[0], f", nor at {len(lost) - 1} more nodes" if len(lost) > 1 else ""
            found.refuse(
                self._called(bus),
                f"GridLAB-D found no solution: it has no voltage in phase {letter}{more}; "
                "look for a value that is not a number, or an impedance of 0, at the bus or before it",
            )
        found.raise_problems()
        self._add_source(branches)
        for name, bus in self._buses.items():
            found.buses[bus["bus"]] = (bus["V_nom"], *model["objects"][name][2])
        if all(self._classes[name] == "player" for name in self._left_out):  # else they are those of another network
            found.V = {(self._buses[bus]["bus"], letter): each for (bus, letter), each in V.items()}
        return found

    def _judge_classes(self) -> None:
        for name, kind in self._classes.items():
            if name not in self._left_out:
                called = self._called(name)
                if kind in NOTED:
                    self._found.notes.append(f"{called}: {NOTED[kind]}")
                elif kind not in KNOWN:
                    self._found.refuse_class(called)

    def _note_settling(self) -> None:
        settling = self._model.get("settling")
        if not settling:
            return
        notes, file, time = self._found.notes, self._found.file, settling["time"]
        if not settling["solved"]:
            text = f"regulators and capacitors stay as at the first moment; GridLAB-D has no solution at {time}"
            notes.append(f"{file}: {text}, before they rest")
            return
        if not settling["rest"]:
            text = f"regulators and capacitors still move at {time}, an hour after the first moment"
            notes.append(f"{file}: {text}; they stay at those positions")
        elif settling["seconds"]:
            notes.append(f"{file}: as GridLAB-D has it at {time}, when its regulators and capacitors rest")

    def _mend_nominal_voltages(self) -> bool:
        """Take the voltage that a bus has for its nominal one, where the model states another one by mistake.

        Return whether each bus has one then.
        """
        mended = True
        for name, bus in self._buses.items():
            V = [abs(V) for V in voltages_of(bus).values() if isfinite(abs(V))]
            live = [each for each in V if each > LIVE * max(V)]
            usual, stated = float(sum(live) / max(len(live), 1)), bus["V_nom"]
            if not stated > 0.0 and not usual > 0.0:
                mended = False
                self._found.refuse(self._called(name), f"nominal_voltage must be above 0 V, got {stated:g} V")
            elif usual and not (stated > 0.0 and 1.0 / FAR < usual / stated < FAR):
                text = f"nominal_voltage is {stated:g} V, but {usual:.0f} V in the power flow, which the import takes"
                self._found.notes.append(f"{self._called(name)}: {text}")
                bus["V_nom"] = usual
        return mended

    def _add_loads(self) -> None:
        takes = {name: own for name, own in self._model["takes"].items() if own and name not in self._left_out}
        passive = {"player", *WATCHING, *CHILD_OF_BUS}
        feeding = {self._parents[name] for name in self._left_out if self._classes[name] not in passive}
        tainted = feeding | {self._bus_of(name) for name in feeding}
        order = {bus: k for k, bus in enumerate(self._buses)}
        for name in sorted(takes, key=lambda name: order.get(self._bus_of(name), -1)):
            called, bus = self._called(name), self._buses.get(self._bus_of(name))
            if bus is None:
                continue
            if name in tainted:
                text = "its own load is not taken over, because GridLAB-D adds the elements that are left out to it"
                self._found.notes.append(f"{called}: {text}")
            elif self._classes[name] == "capacitor":
                self._found.add_element(called, *shunt(bus["bus"], takes[name]))
            else:
                self._found.add_loads(load_parts(called, bus, takes[name]))

    def _bus_of(self, name: str) -> str:
        """Return the bus of the solver that an object is connected to, itself or one it is a child of, or ""."""
        while name and name not in self._buses:
            name = self._parents.get(name, "")
        return name

    def _add_source(self, branches: GlmBranches) -> None:
        # a SWING_PQ takes over only where no SWING is
        found = self._found
        given = [n for n, bus in self._buses.items() if bus["type"] == SWING and n not in self._left_out]
        for name, bus in self._buses.items():
            if bus["type"] == PV or name in given[1:]:
                found.refuse(self._called(name), "a second source; make its bustype PQ")
        if not given:
            found.refuse("no bus with bustype SWING", "a feeder needs one, its substation")
            return
        bus, called = self._buses[given[0]], self._called(given[0])
        if letters_of(bus["phases"]) != "ABC" or bus["phases"] & SPLIT:
            found.refuse(called, "a source needs phases A, B and C")
            return
        V = bus["V"] / bus["V_nom"]
        balanced = np.exp(-2j * np.pi / 3.0 * np.arange(3))
        forward = complex(V @ balanced.conj()) / 3.0
        stiff = bus["bus"]
        if np.abs(V - forward * balanced).max() > BALANCED and abs(forward):
            stiff = branches.add_unbalanced(stiff, V / (forward * balanced))
            found.notes.append(f"{called}: its voltages are unbalanced; a balanced source feeds it")
        found.source = Source(bus=stiff, V_pu=abs(forward), angle=float(np.angle(forward)))
