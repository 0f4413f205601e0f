"""A law that is a functional mock-up unit for co-simulation, FMI 2 or 3, by the package fmpy (extra `fmu`).

Its variables are those of `agents.carriers.fmu_interface`. A step of the law is a step of the FMU over one control
period. `start` resets the FMU.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from contextlib import chdir
from pathlib import Path
from typing import Any

from agents.carriers.fmu_interface import NEIGHBOUR, OF_NEIGHBOUR, fmu_problems, is_fmi3, named
from agents.config import LawChoice
from agents.laws.call import LawError
from agents.laws.law import NOTHING, Law, Neighbour, Own, SetPoints, limits_in
from wire.printable import printable


def _instance(description: Any, folder: str) -> Any:
    """Return the instance of an FMU that is unpacked in a folder, by the version of FMI that it has."""
    if is_fmi3(description):
        from fmpy.fmi3 import FMU3Slave as Slave
    else:
        from fmpy.fmi2 import FMU2Slave as Slave
    with chdir("."):  # fmpy goes to the library's folder, and stays there if the library cannot be loaded
        fmu = Slave(
            guid=description.guid,
            unzipDirectory=folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="law",
        )
    fmu.instantiate()
    return fmu


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
        super().__init__(**limits_in(choice.parameters))
        import fmpy

        self._name, self._parameters = path.name, choice.parameters
        description = fmpy.read_model_description(str(path))
        self._inputs, self._outputs = named(description, "input"), named(description, "output")
        self._settable = named(description, "parameter")
        self._room = max((int(match[1]) for name in self._inputs if (match := NEIGHBOUR.fullmatch(name))), default=0)
        self._shared = [name.removeprefix("shared_") for name in self._outputs if name.startswith("shared_")]
        self._t = 0.0
        self._begun = False
        self._folder = fmpy.extract(str(path))
        try:
            self._fmu = _instance(description, self._folder)
        except Exception as error:  # its library may be anything, and so may what it does when it is loaded
            shutil.rmtree(self._folder, ignore_errors=True)
            text = printable(f"{type(error).__name__}: {error}", 200)
            raise ValueError(f"law {self._name} cannot be instantiated: {text}") from error
        self._fmi3 = is_fmi3(description)
        fmu = self._fmu
        self._put, self._got = (fmu.setFloat64, fmu.getFloat64) if self._fmi3 else (fmu.setReal, fmu.getReal)

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
            self._put([variables[name].valueReference for name in names], [values[name] for name in names])

    def _get(self) -> dict[str, float]:
        got = self._got([variable.valueReference for variable in self._outputs.values()])
        return dict(zip(self._outputs, map(float, got), strict=True))
