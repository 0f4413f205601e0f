"""A law that is a functional mock-up unit for co-simulation, FMI 2 or 3, by the package fmpy (extra `fmu`).

Compiled code cannot be interrupted, and may crash its process. So an FMU runs in a process of its own,
`python -m gridpeers.agents.carriers.fmu PATH FOLDER`, which gets the lines of a law program. Its output goes to
standard error.

docs/how-to/law-programs.md has the lines, and the names and types of the variables; an FMU declares those that it uses.
"""

from __future__ import annotations

import os
import re
import shutil
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import msgspec
from msgspec.structs import replace

from gridpeers.agents.agent_config import LawChoice, SharedQuantity
from gridpeers.agents.carriers.program import ProgramLaw
from gridpeers.agents.laws.call import LawError, decide, start_law
from gridpeers.agents.laws.law import LIMITS, NOTHING_SHARED, Law, Neighbour, Own, SetPoints, limits_in
from gridpeers.wire.driver.command_line import pip_install
from gridpeers.wire.messages import SHARED_LIMIT
from gridpeers.wire.plugins.registry import ANYTHING, named
from gridpeers.wire.schema.table_reading import read_parameters
from gridpeers.wire.wording import printable, suggestion

OWN = tuple(f"own_{name}" for name in Own._fields if name != "name")

OF_NEIGHBOUR = tuple(name for name in Neighbour._fields if name not in ("name", "shared"))

NEIGHBOUR = re.compile(r"neighbour_([1-9][0-9]{0,3})_(?:shared_)?(\w+)")
"""Name of an input of a neighbour: its place and its field."""


def fmu_problems(path: Path, parameters: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return the problems of an FMU as a law, each with the key of the scenario that it concerns."""
    if not path.is_file():
        return [("fmu", f"there is no file {path.name}; give its path relative to the scenario file")]
    try:
        import fmpy
    except ModuleNotFoundError:
        return [("fmu", f"an FMU needs the package fmpy; install it: {pip_install('fmu')}")]
    try:
        description = fmpy.read_model_description(str(path))
        platforms = fmpy.supported_platforms(str(path))
    except Exception as error:  # a file may be anything
        return [("fmu", f"{path.name} is no FMU: {printable(f'{type(error).__name__}: {error}', 200)}")]
    wrong = []
    if description.coSimulation is None:
        wrong.append(f"{path.name} is for model exchange; export it for co-simulation")
    own = {fmpy.platform, fmpy.platform_tuple}
    if not own & set(platforms):
        wrong.append(f"{path.name} is for {', '.join(platforms) or 'no platform'}, and this is {fmpy.platform}")
    inputs, outputs = variables(description, "input"), variables(description, "output")
    for name in inputs:
        match = NEIGHBOUR.fullmatch(name)
        of_neighbour = match is not None and ("_shared_" in name or match[2] in OF_NEIGHBOUR)
        if name not in (*OWN, "T", "neighbours") and not of_neighbour:
            known = (*OWN, "T", "neighbours", *(f"neighbour_1_{field}" for field in OF_NEIGHBOUR))
            wrong.append(f"{path.name} has an input {name}; {suggestion(name, known, 'inputs')}")
    wrong += [f"{path.name} has no output {name}" for name in ("P_set", "V_set") if name not in outputs]
    settable = variables(description, "parameter")
    real = "Float64" if is_fmi3(description) else "Real"
    used = inputs | outputs | {name: variable for name, variable in settable.items() if name in parameters}
    for name, variable in used.items():
        if variable.type != real or variable.dimensions:
            array = "an array of " if variable.dimensions else ""
            wrong.append(f"{path.name} has {name} as {array}{variable.type}; declare it as a scalar {real}")
    unknown = [name for name in parameters if name not in (*settable, *LIMITS)]
    found = [("fmu", text) for text in wrong]
    found += [(name, f"unknown parameter; {suggestion(name, [*settable, *LIMITS], 'parameters')}") for name in unknown]
    found += [
        (name, f"must be a number, got {value!r}")
        for name, value in parameters.items()
        if name in settable and (isinstance(value, bool) or not isinstance(value, int | float))
    ]
    found += read_parameters(Law, limits_in(parameters))[1]
    return found


def shared_by_fmu(path: Path) -> tuple[SharedQuantity, ...]:
    """Return the quantities that an FMU shares, its outputs shared_NAME; none if it cannot be read."""
    try:
        import fmpy

        outputs = variables(fmpy.read_model_description(str(path)), "output")
    except Exception:  # a file may be anything; `fmu_problems` reports it
        return ()
    return tuple(
        SharedQuantity(
            name=name.removeprefix("shared_"),
            unit=it.unit or "",
            low=-SHARED_LIMIT if it.min is None else float(it.min),
            high=SHARED_LIMIT if it.max is None else float(it.max),
            help=it.description or "",
        )
        for name, it in outputs.items()
        if name.startswith("shared_")
    )


def is_fmi3(description: Any) -> bool:
    return str(description.fmiVersion).startswith("3")


def variables(description: Any, causality: str) -> dict[str, Any]:
    return {variable.name: variable for variable in description.modelVariables if variable.causality == causality}


class FmuLaw(ProgramLaw):
    """A law carried by an FMU; raise ValueError if its process cannot be started."""

    def __init__(self, choice: LawChoice) -> None:
        path = (Path(choice.folder) / choice.fmu).absolute()
        self._unpacked = mkdtemp(prefix="gridpeers-fmu-")
        command = (sys.executable, "-P", "-m", "gridpeers.agents.carriers.fmu", str(path), self._unpacked)
        super().__init__(replace(choice, command=command), path.name, self._unpacked)
        self._patience = max(10.0, self._patience)  # s, to be loaded

    def close(self) -> None:
        super().close()
        shutil.rmtree(self._unpacked, ignore_errors=True)


class LoadedFmu(Law):
    """An FMU in this process, unpacked in a folder, as a law; errors of fmpy and the FMU pass through."""

    def __init__(self, path: Path, folder: Path) -> None:
        super().__init__()
        import fmpy

        description = fmpy.read_model_description(str(path))
        fmpy.extract(str(path), str(folder))
        self._inputs, self._outputs = variables(description, "input"), variables(description, "output")
        self._settable = variables(description, "parameter")
        self._room = max((int(match[1]) for name in self._inputs if (match := NEIGHBOUR.fullmatch(name))), default=0)
        self._shared = [name.removeprefix("shared_") for name in self._outputs if name.startswith("shared_")]
        self._given: dict[str, float] = {}
        self._t = 0.0
        self._begun = False
        self._fmi3 = is_fmi3(description)
        self._fmu = fmu = _instance(description, folder)
        self._put, self._got = (fmu.setFloat64, fmu.getFloat64) if self._fmi3 else (fmu.setReal, fmu.getReal)

    def take(self, parameters: Mapping[str, Any]) -> None:
        for name in LIMITS:
            setattr(self, name, float(parameters.get(name, getattr(Law, name))))
        self._given = {name: float(value) for name, value in parameters.items() if name in self._settable}

    def start(self, own: Own) -> None:
        fmu = self._fmu
        if self._begun:
            fmu.terminate()
            fmu.reset()
        self._begun, self._t = True, 0.0
        if not self._fmi3:
            fmu.setupExperiment(startTime=0.0)
        self._set(self._settable, self._given)
        fmu.enterInitializationMode()
        self._set(self._inputs, self._values(own, (), 0.0))
        fmu.exitInitializationMode()

    def step(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> SetPoints:
        if len(neighbours) > self._room and self._room:
            raise LawError(f"it has room for {self._room} neighbours, and {own.name} hears {len(neighbours)}")
        self._set(self._inputs, self._values(own, neighbours, T))
        self._fmu.doStep(currentCommunicationPoint=self._t, communicationStepSize=T)
        self._t += T
        values = self._got([variable.valueReference for variable in self._outputs.values()])
        got = dict(zip(self._outputs, map(float, values), strict=True))
        shared = {name: got[f"shared_{name}"] for name in self._shared} or NOTHING_SHARED
        return SetPoints(got["P_set"], got["V_set"], shared, got.get("send", 1.0) >= 0.5)

    def close(self) -> None:
        if self._begun:
            self._fmu.terminate()
        self._fmu.freeInstance()

    def _values(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> dict[str, float]:
        values = {f"own_{name}": float(value) for name, value in own._asdict().items() if name != "name"}
        values |= {"T": T, "neighbours": float(len(neighbours))}
        for i, other in enumerate(neighbours, start=1):
            values |= {f"neighbour_{i}_{name}": float(getattr(other, name)) for name in OF_NEIGHBOUR}
            values |= {f"neighbour_{i}_shared_{name}": value for name, value in other.shared.items()}
        return values

    def _set(self, known: Mapping[str, Any], values: Mapping[str, float]) -> None:
        names = [name for name in known if name in values]
        if names:
            self._put([known[name].valueReference for name in names], [values[name] for name in names])


def _instance(description: Any, folder: Path) -> Any:
    if is_fmi3(description):
        from fmpy.fmi3 import FMU3Slave as Slave
    else:
        from fmpy.fmi2 import FMU2Slave as Slave
    fmu = Slave(
        guid=description.guid,
        unzipDirectory=str(folder),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="law",
    )
    fmu.instantiate()
    return fmu


def main(path: str, folder: str) -> None:
    lines, answers = sys.stdin.buffer, os.dup(1)
    os.dup2(2, 1)
    law, failed = None, ""
    try:
        law = LoadedFmu(Path(path), Path(folder))
    except ANYTHING as error:  # a file may be anything
        failed = named(error)
    for line in lines:
        asked = msgspec.json.decode(line)
        try:
            answer = {"error": failed} if law is None else _answer(law, asked)
        except LawError as error:
            answer = {"error": str(error)}
        os.write(answers, msgspec.json.encode(answer) + b"\n")
    if law is not None:
        law.close()


def _answer(law: LoadedFmu, asked: dict[str, Any]) -> dict[str, Any]:
    own = Own(**asked["own"])
    if asked["type"] == "start":
        law.take(asked["parameters"])
        start_law(law, own)
        return {"type": "ready"}
    decision = decide(law, own, [Neighbour(**other) for other in asked["neighbours"]], asked["T"])
    return decision._asdict() | {"shared": dict(decision.shared), "terms": None}


if __name__ == "__main__":
    main(*sys.argv[1:])
