"""Run a script of OpenDSS command by command, so that every command that fails is known, with its file and line.

The engine itself stops at the first error. What only shows or writes results is not run.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path

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

    Parameters
    ----------
    execute : Execute
        Runs one command in the engine.
    may_solve : Callable[[], bool]
        Whether a bare `solve` would solve one moment, and not a day or a year.

    Attributes
    ----------
    problems : list of str
        Every command that failed: file, line, the engine's message.
    notes : list of str
        Commands that failed, and on which the network does not depend.
    not_run : dict of str to str
        First place of each kind of command that was not run.
    places : dict of str to str
        First place of each element, and of each "bus NAME" that a property names (lower case).
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
