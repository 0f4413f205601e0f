"""The OpenDSS engine (package dss-python): one circuit, read and solved."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from gridpeers.bridges.import_checks import path_problems
from gridpeers.bridges.opendss.dss_script import HUNTING, DssScript
from gridpeers.bridges.opendss.dss_values import impossible_values, repeated_names

SETTLE = ("set mode=snapshot", "set maxcontroliter=1000", "set maxiterations=1000", "solve")
"""Solves with controls, which set taps and capacitor steps."""

EXACT = ("set controlmode=off", "set tolerance=1e-11", "solve")
"""Solves once more, with all that is controlled left where it stands."""

NO_INVERSE = "Matrix Inversion Error"
"""In the engine's message on an element without impedance."""

MOST = 50
"""How many problems are told."""

FEW = 3
"""How many are told of a script that makes no circuit."""

SNAPSHOT = 0
"""The engine's number of the mode that solves one moment."""


class DssEngine:
    """One circuit in an engine of its own.

    Parameters
    ----------
    tell : Callable[[str], None]
        Takes what the engine is about to do, with file and line.

    Attributes
    ----------
    circuit : dss.ICircuit
        The engine's active circuit.
    notes : list of str
        What was not done as the script says.
    places : dict of str to str
        File and line of each element and "bus NAME" (lower case).
    """

    def __init__(self, tell: Callable[[str], None]) -> None:
        from dss import DSS

        engine = DSS.NewContext()
        engine.AllowForms = engine.AllowEditor = engine.AllowChangeDir = False
        engine.Error.ExtendedErrors = True
        self._engine: Any = engine
        self._tell = tell
        self.notes: list[str] = []
        self.places: dict[str, str] = {}

    @property
    def circuit(self) -> Any:
        """The circuit that was read last."""
        return self._engine.ActiveCircuit

    def read(self, path: Path, scratch: Path | None = None) -> list[str]:
        """Run a script and solve its circuit; return all problems, each with its file and line.

        Parameters
        ----------
        path
            The script.
        scratch
            Folder that takes what the engine writes by itself (traces of controls); else the working folder.
        """
        if problems := path_problems(path):
            return problems
        if scratch is not None:
            self.execute(f'set datapath="{scratch}"')
        script = DssScript(self.execute, self._may_solve)
        script.run(path)
        self.places = script.places
        if not self._engine.NumCircuits:
            none = f"{path.name}: makes no circuit; a script has a line New Circuit.name"
            return [*script.problems[:FEW], none]
        if script.problems:
            return self._clear(script.problems)
        for verb, where in script.not_run.items():
            self.notes.append(f"{where}: {verb} was not run")
        self.notes += script.notes
        for command in SETTLE:
            message = self.execute(command, path.name)
            if HUNTING in message:
                self.notes.append(
                    f"{path.name}: its controls hunt; they stay at their positions of the 1000th iteration"
                )
            elif message:
                return [f"{path.name}: the engine cannot solve the circuit: {message}"]
        if problems := [*impossible_values(self.circuit), *repeated_names(self.circuit)]:
            return problems
        if not self.circuit.Solution.Converged:
            return [f"{path.name}: the engine's power flow does not converge; it would not in OpenDSS either"]
        for command in EXACT:  # may end at rounding instead: not every circuit allows its tolerance
            self.execute(command, path.name)
        return []

    def _clear(self, problems: list[str]) -> list[str]:
        """Return each problem once, lines without an impedance by their names, and not thousands of problems."""
        others = list({problem.partition(" ")[2]: problem for problem in reversed(problems)}.values())[::-1]
        if any(NO_INVERSE in problem for problem in others):
            others = [problem for problem in others if NO_INVERSE not in problem]
            others += [
                f"line.{name}: it has no length or no impedance; leave it out, or give it some (switch=yes does)"
                for name in self._lines_without_impedance()
            ] or problems[:1]
        more = len(others) - MOST
        return [*others[:MOST], f"and {more} problems more"] if more > 0 else others

    def _lines_without_impedance(self) -> list[str]:
        found = []
        for line in self.circuit.Lines if self.circuit.Lines.Count else ():
            zero = not any(line.Rmatrix) and not any(line.Xmatrix)
            if self.circuit.ActiveCktElement.Enabled and (line.Length == 0.0 or zero):
                found.append(str(line.Name).lower())
        return found

    def execute(self, command: str, where: str = "") -> str:
        """Run one command, from there in a script; return the engine's message if it fails."""
        from dss import DSSException

        self._tell(f"{where}: {command}")
        try:
            self._engine.Text.Command = command
        except DSSException as error:
            return " ".join(str(error.args[1] if len(error.args) > 1 else error).split())
        return ""

    def _may_solve(self) -> bool:
        return bool(self._engine.NumCircuits) and self.circuit.Solution.Mode == SNAPSHOT
