"""A law that is a functional mock-up unit for co-simulation, FMI 2 or 3, by the package fmpy (extra `fmu`).

All variables are Real (FMI 2) or Float64 (FMI 3), by these names; an FMU declares those that it uses:

- inputs: own_P, own_e and so on (`Own`); neighbours, how many there are; neighbour_1_P_set and so on (`Neighbour`),
  neighbour_1_shared_NAME for what a neighbour shares, for as many neighbours as the FMU has room for;
- outputs: P_set, V_set, and send (1 or 0), shared_NAME;
- parameters: those of the law, as a scenario gives them.

A step of the law is a step of the FMU over one control period. `start` resets the FMU.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from agents.config import LawChoice
from agents.laws.call import LawError
from agents.laws.law import NOTHING, Law, Neighbour, Own, SetPoints
from wire.nearest import suggestion
from wire.parameters import objections, parameters_of
from wire.printable import printable

OWN = tuple(f"own_{name}" for name in Own._fields if name != "name")
"""Inputs of the own inverter."""

OF_NEIGHBOUR = tuple(name for name in Neighbour._fields if name not in ("name", "shared"))
"""Inputs of each neighbour, without their prefix."""

_NEIGHBOUR = re.compile(r"neighbour_([1-9][0-9]{0,3})_(?:shared_)?(\w+)")


def fmu_problems(path: Path, parameters: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return what keeps an FMU from carrying a law, each with the key of the scenario that it concerns."""
    if not path.is_file():
        return [("fmu", f"there is no file {path.name}; write its path, seen from the scenario")]
    try:
        import fmpy
    except ModuleNotFoundError:
        return [("fmu", "an FMU needs the package fmpy; install it: pip install 'gridpeers[fmu]'")]
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
    inputs, outputs = _named(description, "input"), _named(description, "output")
    for name in inputs:
        if name not in (*OWN, "T", "neighbours") and not _is_of_neighbour(name):
            known = (*OWN, "T", "neighbours", *(f"neighbour_1_{field}" for field in OF_NEIGHBOUR))
            wrong.append(f"{path.name} has an input {name}; {suggestion(name, known, 'inputs')}")
    wrong += [f"{path.name} has no output {name}" for name in ("P_set", "V_set") if name not in outputs]
    limits = parameters_of(Law)
    there = [variable.name for variable in description.modelVariables if variable.causality == "parameter"]
    unknown = [name for name in parameters if name not in there and name not in limits]
    found = [("fmu", text) for text in wrong]
    found += [(name, f"unknown parameter; {suggestion(name, [*there, *limits], 'parameters')}") for name in unknown]
    found += objections(Law, {name: value for name, value in parameters.items() if name in limits})
    return found


def _is_of_neighbour(name: str) -> bool:
    match = _NEIGHBOUR.fullmatch(name)
    return match is not None and ("_shared_" in name or match[2] in OF_NEIGHBOUR)


def _named(description: Any, causality: str) -> dict[str, Any]:
    return {variable.name: variable for variable in description.modelVariables if variable.causality == causality}


class FmuLaw(Law):
    """A law carried by an FMU.

    Parameters
    ----------
    choice : LawChoice
        Its path, parameters and folder.

    Raises
    ------
    ValueError
        If it cannot be loaded, or its variables are not those of a law.
    """

    def __init__(self, choice: LawChoice) -> None:
        path = Path(choice.folder) / choice.fmu
        if wrong := fmu_problems(path, choice.parameters):
            raise ValueError("law " + "; ".join(text for _, text in wrong))
        limits = parameters_of(Law)
        super().__init__(**{name: value for name, value in choice.parameters.items() if name in limits})
        import fmpy

        self._name, self._parameters = path.name, choice.parameters
        description = fmpy.read_model_description(str(path))
        self._folder = fmpy.extract(str(path))
        self._inputs, self._outputs = _named(description, "input"), _named(description, "output")
        self._settable = _named(description, "parameter")
        self._room = max((int(match[1]) for name in self._inputs if (match := _NEIGHBOUR.fullmatch(name))), default=0)
        self._shared = [name.removeprefix("shared_") for name in self._outputs if name.startswith("shared_")]
        self._fmi3 = str(description.fmiVersion).startswith("3")
        if self._fmi3:
            from fmpy.fmi3 import FMU3Slave as Slave
        else:
            from fmpy.fmi2 import FMU2Slave as Slave
        self._fmu = Slave(
            guid=description.guid,
            unzipDirectory=self._folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="law",
        )
        self._t = 0.0
        self._begun = False
        try:
            self._fmu.instantiate()
        except Exception as error:
            shutil.rmtree(self._folder, ignore_errors=True)
            raise ValueError(f"law {self._name} cannot be instantiated: {printable(str(error), 200)}") from error

    def start(self, own: Own) -> None:
        """Reset the FMU, set its parameters, and initialise it with the own inverter."""
        fmu = self._fmu
        if self._begun:
            fmu.terminate()
            fmu.reset()
        self._begun, self._t = True, 0.0
        if not self._fmi3:
            fmu.setupExperiment(startTime=0.0)
        given = {name: float(value) for name, value in self._parameters.items() if name in self._settable}
        self._set(self._settable, given)
        fmu.enterInitializationMode()
        self._set(self._inputs, self._values(own, (), 0.0))
        fmu.exitInitializationMode()

    def step(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> SetPoints:
        """Set the inputs, do one step, and get the outputs."""
        if len(neighbours) > self._room and self._room:
            raise LawError(f"{self._name} has room for {self._room} neighbours, and {own.name} hears {len(neighbours)}")
        self._set(self._inputs, self._values(own, neighbours, T))
        self._fmu.doStep(currentCommunicationPoint=self._t, communicationStepSize=T)
        self._t += T
        got = self._get()
        shared = {name: got[f"shared_{name}"] for name in self._shared} or NOTHING
        return SetPoints(got["P_set"], got["V_set"], shared, got.get("send", 1.0) >= 0.5)

    def close(self) -> None:
        """Free the FMU and remove what was unpacked."""
        try:
            if self._begun:
                self._fmu.terminate()
            self._fmu.freeInstance()
        finally:
            shutil.rmtree(self._folder, ignore_errors=True)

    def _values(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> dict[str, float]:
        values = {f"own_{name}": float(value) for name, value in own._asdict().items() if name != "name"}
        values |= {"T": T, "neighbours": float(len(neighbours))}
        for i, other in enumerate(neighbours, start=1):
            values |= {f"neighbour_{i}_{name}": float(getattr(other, name)) for name in OF_NEIGHBOUR}
            values |= {f"neighbour_{i}_shared_{name}": value for name, value in other.shared.items()}
        return values

    def _set(self, variables: Mapping[str, Any], values: Mapping[str, float]) -> None:
        names = [name for name in variables if name in values]
        if names:
            put = self._fmu.setFloat64 if self._fmi3 else self._fmu.setReal
            put([variables[name].valueReference for name in names], [values[name] for name in names])

    def _get(self) -> dict[str, float]:
        get = self._fmu.getFloat64 if self._fmi3 else self._fmu.getReal
        got = get([variable.valueReference for variable in self._outputs.values()])
        return dict(zip(self._outputs, map(float, got), strict=True))
