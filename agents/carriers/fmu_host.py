"""The process of an FMU that carries a law: `python -m gridpeers.agents.carriers.fmu_host PATH FOLDER`.

It reads and writes the lines of a law program (docs/law-programs.md). What the FMU prints goes to standard error.
"""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from gridpeers.agents.carriers.fmu import NEIGHBOUR, OF_NEIGHBOUR, is_fmi3
from gridpeers.agents.carriers.fmu import named as variables
from gridpeers.agents.laws.call import LawError, decide, start_law
from gridpeers.agents.laws.law import LIMITS, NOTHING_SHARED, Law, Neighbour, Own, SetPoints
from gridpeers.wire.plugins.registry import ANYTHING, named


class LoadedFmu(Law):
    """An FMU in this process, unpacked in a folder, as a law; whatever fmpy or the FMU raises comes through."""

    def __init__(self, path: Path, folder: Path) -> None:
        super().__init__()
        import fmpy

        self._name = path.name
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
    try:
        if law is not None:
            law.close()
    except ANYTHING as error:  # the run is over
        print(f"{law}: cannot be freed: {named(error)}", file=sys.stderr)
    shutil.rmtree(folder, ignore_errors=True)


def _answer(law: LoadedFmu, asked: dict[str, Any]) -> dict[str, Any]:
    if asked["type"] == "load":
        return {"type": "ready"}
    own = Own(**asked["own"])
    if asked["type"] == "start":
        law.take(asked["parameters"])
        start_law(law, own)
        return {"type": "ready"}
    decision = decide(law, own, [Neighbour(**other) for other in asked["neighbours"]], asked["T"])
    return decision._asdict() | {"shared": dict(decision.shared)}


if __name__ == "__main__":
    main(*sys.argv[1:])
