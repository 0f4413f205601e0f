"""The OpenDSS engine (package dss-python): it runs a script command by command, and solves its circuit.

The commands come one by one, so that each problem has a file and a line, and none computes a year or writes a file.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from gridpeers.bridges.feeder_import import FeederImport
from gridpeers.plant.tables.feeder_columns import Manifest
from gridpeers.wire.schema.table_schema import named
from gridpeers.wire.text_file import script_of
from gridpeers.wire.wording import printable

RESULTS = (  # commands that show or write results, or leave the engine
    *("comparecases", "di_plot", "doscmd", "dump", "export", "fileedit", "helpform", "panel", "plot", "quit", "save"),
    *("show", "uuids", "vdiff", "visualize", "yearlycurves"),
)

INCLUDING = ("redirect", "compile")
COORDINATES = ("buscoords", "latlongcoords")  # commands that name a file without saying so
ABBREVIATED = (*INCLUDING, *RESULTS, *COORDINATES, "solve")
"""Commands that may be written by three or more of their first letters, unless these are in `WHOLE`."""

WHOLE = frozenset({"set", "help", "sel", "select", "reset"})
ABOUT_AN_ELEMENT = frozenset({"new", "edit", "~", "m", "more"})
METERS = frozenset({"energymeter", "monitor", "sensor"})  # classes that measure: they have no part in the network
ASIDE = METERS | {"loadshape", "tshape", "priceshape", "spectrum", "tcc_curve"}
"""Classes that a snapshot does without: a mistake in one is a note and no problem."""

FREQUENCY = "the circuit's frequency"  # begins a problem with what `set frequency` or `set defaultbasefrequency` gives
HUNTING = "Max Control Iterations Exceeded"  # in the engine's warning on controls that move on and on
FILE = re.compile(r"""(\b\w*file\s*=\s*)("[^"]+"|'[^']+'|\([^()]+\)|\[[^\[\]]+\]|[^\s,"'()\[\]]+)""", re.IGNORECASE)
"""A file that a property names."""

DEEPEST = 40  # scripts within scripts; more is a script that includes itself
MOST, FEW = 50, 3  # so many problems are told of a script, and of one that makes no circuit
SNAPSHOT = 0  # the engine's number of the mode that solves one moment
SETTLE = ("set mode=snapshot", "set maxcontroliter=1000", "set maxiterations=1000", "solve")
"""Solves with controls, which set taps and capacitor steps."""

EXACT = ("set controlmode=off", "set tolerance=1e-11", "solve")
"""Solves once more, with all that is controlled left where it stands."""


class DssEngine:
    """One circuit in an engine of its own; `tell` takes what the engine is about to do, with file and line.

    Failures on which the network does not depend are notes of `found`.
    """

    def __init__(self, found: FeederImport, tell: Callable[[str], None]) -> None:
        from dss import DSS

        engine = DSS.NewContext()
        engine.AllowForms = engine.AllowEditor = engine.AllowChangeDir = False
        engine.Error.ExtendedErrors = True
        self._engine: Any = engine
        self._found, self._tell = found, tell
        self._folder = Path()
        self._problems: dict[str, str] = {}  # by message: where it came first
        self._not_run: dict[str, str] = {}

    @property
    def circuit(self) -> Any:
        return self._engine.ActiveCircuit

    def read(self, path: Path, scratch: Path) -> None:
        """Run a script and solve its circuit; FeederError has all problems, each with its file and line.

        `scratch` takes what the engine writes by itself (traces of controls).
        """
        found, problems, places = self._found, self._found.problems, self._found.places
        self.execute(f'set datapath="{scratch}"')
        self._run(path, path.name, depth=0)
        problems += [f"{where}: {message}" for message, where in self._problems.items()]
        if not self._engine.NumCircuits:
            problems[FEW:] = [f"{path.name}: makes no circuit; write a line New Circuit.name"]
        elif (more := len(problems) - MOST) > 0:
            problems[MOST:] = [f"and {more} more problems"]
        found.raise_problems()
        found.notes[:0] = [f"{where}: {verb} was not run" for verb, where in self._not_run.items()]
        for command in SETTLE:
            message = self.execute(command, path.name)
            if HUNTING in message:
                found.notes.append(
                    f"{path.name}: its controls hunt; they stay at their positions of the 1000th iteration"
                )
            elif message:
                found.refuse(path.name, f"the engine cannot solve the circuit: {message}")
                found.raise_problems()
        self._refuse_impossible_values()
        found.raise_problems()
        if not self.circuit.Solution.Converged:
            found.refuse(
                path.name,
                "the power flow does not converge in the engine, nor would it in OpenDSS; correct the circuit there",
            )
            found.raise_problems()
        for command in EXACT:  # may end at rounding instead: not every circuit allows its tolerance
            self.execute(command, path.name)
        for name in self.circuit.AllElementNames:
            self.circuit.SetActiveElement(name)
            for bus in self.circuit.ActiveCktElement.BusNames:
                if place := places.get(str(name).lower()):
                    places.setdefault(f"bus {bus_of(bus)}", place)

    def _refuse_impossible_values(self) -> None:
        """Refuse each value with which no power flow has a solution."""
        circuit = self.circuit
        if text := named(Manifest, "f_nom_Hz").objection(float(circuit.Solution.Frequency)):
            self._found.refuse(FREQUENCY, f"{text}; correct Set DefaultBaseFrequency or Set Frequency")
        for rows in (circuit.Loads, circuit.Capacitors, circuit.Transformers):
            for row in rows if rows.Count else ():
                element = circuit.ActiveCktElement
                name = str(element.Name).lower()
                values = {}
                if not name.startswith("transformer."):
                    values["kv"] = (row.kV, "kV")
                else:
                    for winding in range(1, row.NumWindings + 1):
                        row.Wdg = winding
                        values[f"kv of winding {winding}"] = (row.kV, "kV")
                        values[f"kva of winding {winding}"] = (row.kVA, "kVA")
                for key, (value, unit) in values.items():
                    if element.Enabled and not 0.0 < value < inf:
                        self._found.refuse(name, f"{key} must be above 0, got {value:g} {unit}")

    def execute(self, command: str, where: str = "") -> str:
        from dss import DSSException

        self._tell(f"{where}: {command}")
        try:
            self._engine.Text.Command = command
        except DSSException as error:
            return printable(" ".join(str(error.args[-1]).split()))
        return ""

    def _run(self, path: Path, where: str, depth: int) -> None:
        """Run a script; what it includes is sought beside it."""
        if depth > DEEPEST:
            self._problems.setdefault("includes itself, directly or through others", where)
            return
        try:
            text = script_of(path.read_bytes())
        except OSError as error:
            self._problems.setdefault(f"{path.name} cannot be read: {error.strerror}", where)
            return
        before, self._folder = self._folder, path.parent
        for number, command in commands_of(text):
            self._one(command, f"{path.name}:{number}", depth)
        self._folder = before

    def _one(self, command: str, where: str, depth: int) -> None:
        first, _, rest = command.replace("\t", " ").partition(" ")
        verb = first.lower()
        if len(verb) > 2 and verb not in WHOLE:
            verb = next((name for name in ABBREVIATED if name.startswith(verb)), verb)
        setting = re.match(r"set\s+(\w+)\s*=", command, re.IGNORECASE)
        key = setting[1].lower() if setting else ""
        if verb in INCLUDING:
            path = found_file(self._folder / bare(rest))
            if path is None:
                text = f"includes {bare(rest)}, which does not exist in {self._folder}"
                self._problems.setdefault(text, where)
            else:
                self._run(path, where, depth + 1)
            return
        if verb in RESULTS or (verb == "solve" and (rest.strip() or not self._may_solve())) or key == "datapath":
            self._not_run.setdefault(f"set {key}" if key else verb, where)
            return
        if "freq" in key:
            self._found.places[FREQUENCY] = where
        if verb in COORDINATES:
            command = f'{verb} "{self._whole_path(rest)}"'
        else:
            command = FILE.sub(lambda match: f'{match[1]}"{self._whole_path(match[2])}"', command)
        message = self.execute(command, where)
        name = ""
        if self._engine.NumCircuits and (verb in ABOUT_AN_ELEMENT or "." in first):
            name = str(self.circuit.ActiveDSSElement.Name).lower()
            self._found.places.setdefault(name, where)
        kind = name.partition(".")[0]
        if not message or (verb == "solve" and HUNTING in message):
            return
        if verb in COORDINATES or kind in ASIDE:
            self._found.notes.append(f"{where}: {message}")
        else:
            self._problems.setdefault(message, where)
        if kind in METERS:  # the engine solves nothing while one measures nowhere
            self.execute(f"disable {name}", where)

    def _may_solve(self) -> bool:
        """Return whether a bare `solve` would solve one moment, and not a day or a year."""
        return bool(self._engine.NumCircuits) and self.circuit.Solution.Mode == SNAPSHOT

    def _whole_path(self, name: str) -> str:
        """Return a file's whole path, as the engine stays in one working folder; the name if there is no such file."""
        path = found_file(self._folder / bare(name))
        return bare(name) if path is None else str(path.resolve())


def bus_of(terminal: Any) -> str:
    """Return the bus of a terminal such as "B12.1.2.3"."""
    return str(terminal).partition(".")[0].lower()


def commands_of(text: str) -> Iterator[tuple[int, str]]:
    r"""Yield the commands of a script with the numbers of their lines.

    >>> list(commands_of("clear ! begin\n/* not\nthis */\n\n  new circuit.x // that\n~ basekv=4.16"))
    [(1, 'clear'), (5, 'new circuit.x'), (6, '~ basekv=4.16')]
    """
    commented = False
    for number, line in enumerate(text.splitlines(), start=1):
        commented = commented or line.lstrip().startswith("/*")
        if commented:
            commented = "*/" not in line
        elif command := re.match(r"""(?:"[^"]*"|'[^']*'|(?!!|//).)*""", line)[0].strip():  # type: ignore[index]
            yield number, command


def bare(name: str) -> str:
    """Return a file's name without the quotes or brackets around it, its folders parted as on this system."""
    text = re.sub(r"^file\s*=\s*", "", name.strip(), flags=re.IGNORECASE)
    quoted = re.match(r"""["'](.*?)["']|[(\[{](.*?)[)\]}]""", text)
    return ((quoted[1] or quoted[2] or "") if quoted else text).strip().replace("\\", "/")


def found_file(path: Path) -> Path | None:
    """Return a file, its name in any case of letters, as scripts are written on systems that do not mind; or None."""
    here = Path(path.anchor)
    for part in path.relative_to(path.anchor).parts:
        if not (here / part).exists():
            beside = sorted(here.iterdir()) if here.is_dir() else []
            part = next((each.name for each in beside if each.name.lower() == part.lower()), part)
        here /= part
    return here if here.is_file() else None


FAR = 1.5  # ratio of two voltages that only a lost factor explains, such as that between phases and to ground
DEAD = 0.01  # voltage (pu) below which nothing feeds a node, so that nothing can be said of it


def note_unusual_voltages(found: FeederImport) -> None:
    """Note loads whose `kv` is far from the voltage that they have."""
    far: dict[str, float] = {}
    for part in found.load_parts:
        one, other = (found.V.get((part.bus, letter), 0j) for letter in part.ends)
        ratio = abs(one - other) / part.V_nom
        if ratio > DEAD and not 1.0 / FAR <= ratio <= FAR:
            far.setdefault(part.name, ratio)
    if far:
        name, more = next(iter(far)), f" (and {len(far) - 1} more)" * (len(far) > 1)
        found.notes.append(
            f"{name}{more}: its voltage is {far[name]:.2g} times its kv, and beyond Vminpu and Vmaxpu a load does not "
            "take its kw; correct kv, or the network before it"
        )


def complexes(values: Any) -> np.ndarray[Any, np.dtype[np.complex128]]:
    """Return the pairs of real numbers that the engine gives as complex numbers."""
    return np.asarray(values, float).view(complex)
