"""Texts of GridLAB-D: of a model, with the lines and classes of its objects, and what GridLAB-D complains of."""

from __future__ import annotations

import re
from pathlib import Path

from gridpeers.wire.wording import printable

INCLUDE = re.compile(r'^\s*#include\s+["<]([^">]+)[">]', re.IGNORECASE)

RUNNING = re.compile(r"^\s*(?:#(?:system|exec|start|wget|option)|script\s+\w+)|^link(?=\s)", re.IGNORECASE)
"""Commands that run a program, load one, or fetch a file."""

COMMENT = re.compile(r'//(?=(?:[^"]*"[^"]*")*[^"]*$)')  # the mark of a comment, not within quotes
OBJECT = re.compile(r"(?:^|[{};\s])object\s+(\w+)(?=[\s{:]|$)")  # the beginning of an object, with its class
NAMED = re.compile(r"""(?:^|[{;\s])name\s+(?:"([^"]+)"|'([^']+)'|([^";\s]+))\s*;""")  # an object's name
UNNAMED = re.compile(r"(\w+)_auto_(\d+)")
"""The name that GridLAB-D gives an object without one: its class and its number among all objects."""

DEEPEST = 40  # models within models; more is one that includes itself


class GlmText:
    """A model and all that it includes, in UTF-8, which alone GridLAB-D knows."""

    def __init__(self, path: Path) -> None:
        self.problems: list[str] = []
        self._path = path
        self._places: dict[str, str] = {}
        self._objects: list[tuple[str, str]] = []  # class and place of each object
        self._read(path, 0)

    def place(self, name: str) -> str:
        """Return the file and line of an object by the name that GridLAB-D has for it; "" if they are not known."""
        unnamed = UNNAMED.fullmatch(name)
        if unnamed and int(unnamed[2]) < len(self._objects):
            kind, place = self._objects[int(unnamed[2])]
            if kind == unnamed[1]:
                return place
        return self._places.get(name, "")

    def _read(self, path: Path, depth: int) -> None:
        if depth > DEEPEST:
            self.problems.append(f"{path.name}: includes itself, directly or through others")
            return
        try:
            text = path.read_text(encoding="utf-8")
        except OSError:
            return  # GridLAB-D says so, with the line that includes it
        except UnicodeDecodeError:
            text = "\ufeff"
        if text.startswith("\ufeff") or "\0" in text:
            self.problems.append(f"{path.name}: is not in UTF-8, or begins with a byte order mark; save it as UTF-8")
            return
        for number, whole in enumerate(text.split("\n"), start=1):
            line, where = COMMENT.split(whole, maxsplit=1)[0], f"{path.name}:{number}"
            if command := RUNNING.match(line):
                self.problems.append(f"{where}: {command[0].strip()} would run or load a program; remove this line")
            self._objects += [(kind, where) for kind in OBJECT.findall(line)]
            for name in NAMED.findall(line):
                self._places.setdefault("".join(name).strip(), where)
            if included := INCLUDE.match(whole):
                # GridLAB-D seeks it from its working folder, which is that of the first model
                self._read(self._path.parent / included[1].replace("\\", "/"), depth + 1)


PLACED = re.compile(r"^(?P<file>\S[^()]*)\((?P<line>\d+)\)\s*: (?P<text>.*)$")
"""A message of the loader: file, line, text."""

LEVELLED = re.compile(r"^(?:ERROR|FATAL)\s+\[[^\]]*\]\s*: (?P<text>.*)$")  # A message of the simulation that ends it
FOLLOWING = re.compile(  # messages that only repeat that something failed
    r"load failed at or near|unable to load '|failed to load model file|model initialization failed"
    r"|run_preparation\(\) returned|shutdown after simulation|last (error|warning) message was repeated"
    r"|Failed to initialize simulation|initialization failed$|dump complete to|tzinfo\.txt|environment startup failed"
)


def messages(printed: str) -> list[str]:
    r"""Return what GridLAB-D complains of, each message once; what only repeats that something failed if nothing else.

    >>> messages("x.glm(3): class 'foo' is not known\nx.glm(3): load failed at or near 'object foo'\n")
    ["x.glm:3: class 'foo' is not known"]
    >>> messages("ERROR    [INIT] : NR: no swing bus found\nWARNING  [INIT] : slow\n")
    ['GridLAB-D: NR: no swing bus found']
    """
    found: list[str] = []
    following: list[str] = []
    for line in printed.replace("\r", "\n").splitlines():
        placed, levelled = PLACED.match(line), LEVELLED.match(line)
        if placed:
            text = f"{Path(placed['file']).name}:{placed['line']}: {printable(placed['text'].strip())}"
        elif levelled:
            text = f"GridLAB-D: {printable(levelled['text'].strip())}"
        else:
            continue
        (following if FOLLOWING.search(line) else found).append(text)
    found.sort(key=lambda text: text.startswith("GridLAB-D: "))  # those with a file and a line come first
    return list(dict.fromkeys(found or following))


CHILD_OF_BUS = ("node", "load", "meter", "triplex_node", "triplex_meter", "triplex_load", "capacitor", "substation")
"""Classes that can take power where they are connected. `pqload` can, too, but is refused."""

SWITCHES = frozenset({"switch", "recloser", "sectionalizer"})
"""Classes that open and close: ideal switches before what they have of impedance."""

LINES = frozenset({"overhead_line", "underground_line", "triplex_line", "line"})  # classes of lines
LINEAR = LINES | {"transformer", "regulator", "fuse", "series_reactor"}  # classes that an admittance matrix describes
DATA = frozenset(  # classes that others refer to
    [
        *("line_configuration", "line_spacing", "overhead_line_conductor", "underground_line_conductor"),
        *("triplex_line_conductor", "triplex_line_configuration", "transformer_configuration"),
        "regulator_configuration",
    ]
)

WATCHING = frozenset(
    [
        *("recorder", "multi_recorder", "group_recorder", "collector", "histogram", "violation_recorder"),
        *("voltdump", "currdump", "impedance_dump", "jsondump", "billdump", "load_tracker", "emissions"),
        *("assert", "double_assert", "complex_assert", "enum_assert", "int_assert", "string_assert"),
        *("metrics", "power_metrics", "metrics_collector", "metrics_collector_writer"),
        *("climate", "weather", "csv_reader", "fault_check", "eventgen", "restoration"),
    ]
)
"""Classes that measure, or act only later or on what is refused anyway: they have no part in the network."""
