"""The OpenDSS engine (package dss-python): one circuit, read and solved."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from gridpeers.bridges.import_checks import path_problems
from gridpeers.plant.equipment import PHASES
from gridpeers.plant.equipment.connectivity import Node
from gridpeers.plant.equipment.imported_equipment import LoadPart
from gridpeers.plant.tables.feeder_columns import Manifest
from gridpeers.wire.schema.table_schema import named
from gridpeers.wire.text_file import script_of
from gridpeers.wire.wording import printable

Execute = Callable[[str, str], str]
"""Runs one command in the engine, from this file and line; returns its message if it fails, else an empty text."""

RESULTS = frozenset(
    [
        "show",
        "plot",
        "visualize",
        "export",
        "dump",
        "fileedit",
        "helpform",
        "quit",
        "panel",
        "di_plot",
        "comparecases",
        "yearlycurves",
        "doscmd",
        "save",
        "uuids",
        "vdiff",
    ]
)
"""Commands that show or write results, or leave the engine."""

INCLUDING = frozenset({"redirect", "compile"})
"""Commands that run another script; `compile` also makes its folder the working folder."""

COORDINATES = frozenset({"buscoords", "latlongcoords"})
"""Commands that name a file without saying so."""

METERS = frozenset({"energymeter", "monitor", "sensor"})
"""Classes that measure: they have no part in the network."""

ASIDE = METERS | {"loadshape", "tshape", "priceshape", "spectrum", "tcc_curve"}
"""Classes that a snapshot does without: one that fails is a note."""

FREQUENCY = "the circuit's frequency"
"""Begins a problem with what `set frequency` or `set defaultbasefrequency` says."""

HUNTING = "Max Control Iterations Exceeded"
"""In the engine's warning on controls that move on and on: the import solves once more, and tells."""

CLOSING = {'"': '"', "'": "'", "(": ")", "[": "]", "{": "}"}
"""Closing mark of a quoted name, by its opening mark."""

BUS = re.compile(r"""\bbus(?:es|\d)?\s*=\s*("[^"]+"|'[^']+'|\([^()]+\)|\[[^\[\]]+\]|[^\s,"'()\[\]]+)""", re.IGNORECASE)
"""A bus, or several, to which a property connects an element."""

ONE_BUS = re.compile(r""""([^"]+)"|'([^']+)'|([^\s,]+)""")
"""One of several buses."""

FILE = re.compile(r"""(\b\w*file\s*=\s*)("[^"]+"|'[^']+'|\([^()]+\)|\[[^\[\]]+\]|[^\s,"'()\[\]]+)""", re.IGNORECASE)
"""A file that a property names."""

NOT_SHORT = frozenset({"set", "help", "sel", "select", "reset"})
"""Commands that are no abbreviation of others."""

KNOWN = (*sorted(INCLUDING | RESULTS | COORDINATES), "solve")

SHORTEST = 3
"""Letters that an abbreviated command has at least: "redir"."""

DEEPEST = 40
"""Scripts within scripts; more is a script that includes itself."""


class DssScript:
    """A script of OpenDSS and all that it includes.

    Its `problems` are the commands that failed, its `notes` those on which the network does not depend; `not_run` has
    the first place of each kind of command that was not run, `places` that of each element and "bus NAME" (lower case).
    `may_solve` returns whether a bare `solve` would solve one moment, and not a day or a year.
    """

    def __init__(self, execute: Execute, may_solve: Callable[[], bool]) -> None:
        self._execute, self._may_solve = execute, may_solve
        self.problems: list[str] = []
        self.notes: list[str] = []
        self._element = ""
        self.not_run: dict[str, str] = {}
        self.places: dict[str, str] = {}
        self._folder = Path()

    def run(self, path: Path) -> None:
        """Run a script; what it includes is sought beside the script that includes it."""
        self._folder = path.parent
        self._run(path, path.name, depth=0)

    def _run(self, path: Path, where: str, depth: int) -> None:
        if depth > DEEPEST:
            self.problems.append(f"{where}: includes itself, directly or through others")
            return
        try:
            text = script_of(path.read_bytes())
        except OSError as error:
            self.problems.append(f"{where}: {path.name} cannot be read: {error.strerror}")
            return
        before, self._folder = self._folder, path.parent
        for number, command in commands_of(text):
            self._one(command, f"{path.name}:{number}", depth)
        self._folder = before

    def _one(self, command: str, where: str, depth: int) -> None:
        first, _, rest = command.replace("\t", " ").partition(" ")
        verb = _full_name(first.lower())
        if verb in INCLUDING:
            self._include(rest, where, depth)
        elif verb in RESULTS or (verb == "solve" and (rest.strip() or not self._may_solve())):
            self.not_run.setdefault(verb, where)
        elif re.match(r"set\s+datapath\s*=", command, re.IGNORECASE):
            self.not_run.setdefault("set datapath", where)
        else:
            if verb in COORDINATES:
                command = f'{verb} "{self._whole_path(_bare(rest))}"'
            else:
                command = FILE.sub(lambda match: f'{match[1]}"{self._whole_path(_bare(match[2]))}"', command)
            self._element = element_of(command, self._element)
            for name in (self._element, *(f"bus {bus}" for bus in buses_of(command))):
                if name:
                    self.places.setdefault(name, where)
            if re.match(r"set\s+\w*freq\w*\s*=", command, re.IGNORECASE):
                self.places[FREQUENCY] = where
            message = printable(self._execute(command, where))
            if message and not (verb == "solve" and HUNTING in message):
                self._failed(verb, where, message)

    def _failed(self, verb: str, where: str, message: str) -> None:
        text = f"{where}: {message}"
        kind = self._element.partition(".")[0]
        if verb not in COORDINATES and kind not in ASIDE:
            self.problems.append(text)
            return
        self.notes.append(text)
        if kind in METERS:  # the engine solves nothing while one measures nowhere
            self._execute(f"disable {self._element}", where)

    def _include(self, rest: str, where: str, depth: int) -> None:
        name = _bare(rest)
        path = _found(self._folder / name)
        if path is None:
            self.problems.append(f"{where}: {name} is included, and there is no such file in {self._folder}")
        else:
            self._run(path, where, depth + 1)

    def _whole_path(self, name: str) -> str:
        """Return a file's whole path, as the engine stays in one working folder; the name if there is no such file."""
        path = _found(self._folder / name)
        return name if path is None else str(path.resolve())


def commands_of(text: str) -> Iterator[tuple[int, str]]:
    r"""Yield the commands of a script with the numbers of their lines.

    Examples
    --------
    >>> list(commands_of("clear ! begin\n/* not\nthis */\n\n  new circuit.x // that\n~ basekv=4.16"))
    [(1, 'clear'), (5, 'new circuit.x'), (6, '~ basekv=4.16')]
    """
    commented = False
    for number, line in enumerate(text.splitlines(), start=1):
        if line.lstrip().startswith("/*"):
            commented = True
        if commented:
            commented = "*/" not in line
            continue
        command = _without_comment(line).strip()
        if command:
            yield number, command


def element_of(command: str, before: str) -> str:
    """Return the element (lower case) that a command is about; that of the command before if it goes on.

    Examples
    --------
    >>> element_of("New object=LoadShape.a npts=2", ""), element_of("~ mult=(1 2)", "loadshape.a")
    ('loadshape.a', 'loadshape.a')
    >>> element_of('New "Line.x 1" bus1=b', ""), element_of("New Circuit.c basekv=4", "")
    ('line.x 1', 'vsource.source')
    >>> element_of("Load.a.kw=3", "line.x"), element_of('new "Line.x-1" bus1=b', ""), element_of("solve", "line.x")
    ('load.a', 'line.x-1', '')
    """
    if re.match(r"(~|m\b|more\b)", command, re.IGNORECASE):
        return before
    made = re.match(
        r"""(?:new|edit|batchedit)\s+(?:object\s*=\s*)?(?:["'(\[{](\w+\.[^"')\]}]+)|(\w+\.[^\s,=]+))""",
        command,
        re.IGNORECASE,
    )
    if made:
        name = (made[1] or made[2]).lower()
        return "vsource.source" if name.startswith("circuit.") else name
    found = re.match(r"(\w+\.[^\s.=]+)\.[^=\s]+\s*=", command)
    return found[1].lower() if found else ""


def buses_of(command: str) -> list[str]:
    """Return the buses (lower case) that the properties of a command name.

    Examples
    --------
    >>> buses_of('New Line.a bus1="Src bus.1.2" bus2=b.3'), buses_of("~ buses=[x.1, 'y z']")
    (['src bus', 'b'], ['x', 'y z'])
    """
    found = []
    for match in BUS.finditer(command):
        text = match[1]
        inner = text[1:-1] if text[0] in CLOSING else text
        several = text[0] in "([{" and "es" in match[0].lower().partition("=")[0]
        names = ["".join(one) for one in ONE_BUS.findall(inner)] if several else [inner]
        found += [name.partition(".")[0].lower() for name in names]
    return found


def _full_name(verb: str) -> str:
    """Return the command that an abbreviation stands for, if it is one that matters here."""
    if len(verb) >= SHORTEST and verb not in NOT_SHORT:
        return next((name for name in KNOWN if name.startswith(verb)), verb)
    return verb


def _bare(name: str) -> str:
    """Return a file's name without the quotes or brackets around it, its folders parted as on this system."""
    text = re.sub(r"^file\s*=\s*", "", name.strip(), flags=re.IGNORECASE).strip()
    close = CLOSING.get(text[:1])
    text = text[1:].partition(close)[0] if close else text
    return text.strip().replace("\\", "/")


def _without_comment(line: str) -> str:
    """Return a line up to its comment; the marks of one count as text within quotes."""
    quote = ""
    for i, char in enumerate(line):
        if quote:
            quote = "" if char == quote else quote
        elif char in "\"'":
            quote = char
        elif char == "!" or line.startswith("//", i):
            return line[:i]
    return line


def _found(path: Path) -> Path | None:
    """Return a file, its name in any case of letters, as scripts are written on systems that do not mind; or None."""
    if path.is_file():
        return path
    here = Path(path.anchor) if path.is_absolute() else Path()
    for part in path.relative_to(here).parts if path.is_absolute() else path.parts:
        if part == "..":
            here = here / part
            continue
        if (here / part).exists():
            here = here / part
            continue
        same = [each for each in _children(here) if each.name.lower() == part.lower()]
        if not same:
            return None
        here = same[0]
    return here if here.is_file() else None


def _children(folder: Path) -> list[Path]:
    try:
        return sorted(folder.iterdir())
    except OSError:
        return []


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
    """One circuit in an engine of its own; `tell` takes what the engine is about to do, with file and line."""

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

        `scratch` takes what the engine writes by itself (traces of controls).
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


FAR = 1.5
"""Ratio of two voltages that only a lost factor explains, such as that between phases and to ground."""

DEAD = 0.01
"""Voltage (pu) below which nothing feeds a node, so that nothing can be said of it."""


def impossible_values(circuit: Any) -> list[str]:
    """Return a problem for each value with which no power flow has a solution; a circuit that has been read."""
    frequency = float(circuit.Solution.Frequency)
    text = named(Manifest, "f_nom_Hz").objection(frequency)
    problems = [f"{FREQUENCY}: {text}; correct Set DefaultBaseFrequency or Set Frequency"] if text else []
    for load in circuit.Loads if circuit.Loads.Count else ():
        if not circuit.ActiveCktElement.Enabled:
            continue
        name, kV = f"load.{str(load.Name).lower()}", float(load.kV)
        if not (kV > 0.0 and isfinite(kV)):
            problems.append(f"{name}: kv must be above 0, got {kV:g} kV; give the voltage of its bus")
        if not (isfinite(load.kW) and isfinite(load.kvar)):
            problems.append(f"{name}: kw and kvar must be numbers, got {load.kW:g} kW and {load.kvar:g} kvar")
    for bank in circuit.Capacitors if circuit.Capacitors.Count else ():
        if circuit.ActiveCktElement.Enabled and not bank.kV > 0.0:
            problems.append(f"capacitor.{str(bank.Name).lower()}: kv must be above 0, got {bank.kV:g} kV")
    transformers = circuit.Transformers
    for transformer in transformers if transformers.Count else ():
        if not circuit.ActiveCktElement.Enabled:
            continue
        for winding in range(1, transformer.NumWindings + 1):
            transformer.Wdg = winding
            for key, value, unit in (("kv", transformer.kV, "kV"), ("kva", transformer.kVA, "kVA")):
                if not (value > 0.0 and isfinite(value)):
                    problems.append(
                        f"transformer.{str(transformer.Name).lower()}: {key} of winding {winding} must be above 0, "
                        f"got {value:g} {unit}"
                    )
    return problems


def repeated_names(circuit: Any) -> list[str]:
    """Return a problem for each name that several elements have: the engine finds one of them alone by it."""
    names = Counter(str(name).lower() for name in circuit.AllElementNames)
    return [
        f"{name}: {count} elements have this name; names must differ (set AllowDuplicates=no tells where they stand)"
        for name, count in names.items()
        if count > 1 and not name.startswith("load.")  # loads are read one after the other, not by name
    ]


def unusual_voltages(circuit: Any, parts: Sequence[LoadPart], V: Mapping[Node, complex]) -> list[str]:
    """Return notes on loads whose `kv`, and buses whose voltage base, is far from the voltage that they have (V)."""
    strange: dict[str, str] = {}
    for part in parts:
        V_part = abs(V.get((part.bus, part.ends[0]), 0j) - V.get((part.bus, part.ends[1]), 0j))
        if V_part > DEAD * part.V_nom and not 1.0 / FAR <= V_part / part.V_nom <= FAR:
            strange.setdefault(part.name, f"{V_part / 1e3:.3g} kV across a part that kv makes {part.V_nom / 1e3:.3g}")
    notes = []
    if strange:
        notes.append(
            f"{_several(list(strange))}: has {next(iter(strange.values()))} kV; beyond Vminpu and Vmaxpu a load does "
            "not take its kw; correct kv, or what feeds it"
        )
    based: dict[str, float] = {}
    unbased = []
    for bus in dict.fromkeys(bus for bus, _ in V):
        circuit.SetActiveBus(bus)
        V_base = 1e3 * float(circuit.ActiveBus.kVBase)
        V_bus = float(np.max([abs(V.get((bus, letter), 0j)) for letter in PHASES]))
        if V_base <= 0.0:
            unbased.append(bus)
        elif V_bus > DEAD * V_base and not 1.0 / FAR <= V_bus / V_base <= FAR:
            based[bus] = V_bus / V_base
    if based:
        notes.append(
            f"bus {_several(list(based))}: has {next(iter(based.values())):.2g} times its voltage base; correct "
            "Set VoltageBases, or the kvs of a transformer"
        )
    if unbased:
        notes.append(
            f"bus {_several(unbased)}: without a voltage base, so that the voltage there counts as nominal; "
            "write Set VoltageBases=[...] and CalcVoltageBases"
        )
    return notes


def _several(names: Sequence[str]) -> str:
    """Return the first of several names, and how many more there are."""
    more = len(names) - 1
    return f"{names[0]} (and {more} more)" if more else names[0]
