"""The text of a model for GridLAB-D: commands that we do not let run, and the lines on which objects stand."""

from __future__ import annotations

import re
from pathlib import Path

from gridpeers.wire.text_file import script_of

INCLUDE = re.compile(r'^(\s*#include\s+["<])([^">]+)([">])', re.IGNORECASE)

RUNNING = re.compile(r"^\s*(?:#(?:system|exec|start|wget|option)|script\s+\w+)|^link(?=\s)", re.IGNORECASE)
"""Commands that run a program, load one, or fetch a file."""

COMMENT = re.compile(r'//(?=(?:[^"]*"[^"]*")*[^"]*$)')
"""The mark of a comment, not within quotes."""

OBJECT = re.compile(r"(?:^|[{};\s])object\s+(\w+)(?::(?:(\d*)\.\.(\d+)|\w*))?(?=[\s{]|$)")
"""The beginning of an object, or of several: class, first and last number."""

NAMED = re.compile(r"""(?:^|[{;\s])name\s+(?:"([^"]+)"|'([^']+)'|([^";\s]+))\s*;""")
"""An object's name."""

UNNAMED = re.compile(r"(\w+)_auto_(\d+)")
"""The name that GridLAB-D gives an object without one: its class and its number among all objects."""

PLAIN = re.compile(r"[\w ,.:/\\-]+", re.ASCII)
"""A path from which GridLAB-D includes a model: "+" or "(" in it are a syntax error at its first line."""

DEEPEST = 40
"""Models within models; more is one that includes itself."""


class GlmText:
    """A model and all that it includes, in whatever encoding they are."""

    def __init__(self, path: Path) -> None:
        self.problems: list[str] = []
        self._path, self._texts = path, dict[Path, str]()
        self._recoded = False
        self._places: dict[str, str] = {}
        self._objects: list[tuple[str, str]] = []
        """Class and place of each object."""
        self._read(path, path.parent, 0)

    def place(self, name: str) -> str:
        """Return the file and line of an object by the name that GridLAB-D has for it; "" if they are not known."""
        unnamed = UNNAMED.fullmatch(name)
        if name in self._places or not unnamed:
            return self._places.get(name, "")
        kind, number = unnamed[1], int(unnamed[2])
        there = self._objects[number] if number < len(self._objects) else ("", "")
        return there[1] if there[0] == kind else ""

    def readable(self, folder: Path) -> Path:
        """Return a model that GridLAB-D can read: this one, or a copy in a folder.

        It knows UTF-8 alone, and includes nothing from a path that is not plain.
        """
        if not self._recoded and (len(self._texts) == 1 or all(PLAIN.fullmatch(str(path)) for path in self._texts)):
            return self._path
        copies = {path: folder / str(k) / path.name for k, path in enumerate(self._texts)}

        def copy_of(match: re.Match[str]) -> str:
            copy = copies.get(self._included(match))
            return f"{match[1]}{copy}{match[3]}" if copy else match[0]

        for path, copy in copies.items():
            copy.parent.mkdir()
            lines = [INCLUDE.sub(copy_of, line) for line in self._texts[path].split("\n")]
            copy.write_bytes("\n".join(lines).encode())
        return copies[self._path]

    def _included(self, match: re.Match[str]) -> Path:
        # GridLAB-D seeks it from its working folder, which is that of the first model
        return self._path.parent / match[2].replace("\\", "/")

    def _read(self, path: Path, folder: Path, depth: int) -> None:
        if depth > DEEPEST:
            self.problems.append(f"{path.name}: includes itself, directly or through others")
            return
        try:
            data = path.read_bytes()
        except OSError:
            return  # GridLAB-D says so, with the line that includes it
        text = self._texts[path] = script_of(data)
        if "\0" in text:
            self.problems.append(f"{path.name}: has bytes that are zero: it is no text; name a model")
            return
        self._recoded |= data != text.encode()
        for number, line in enumerate(text.split("\n"), start=1):
            self._note(COMMENT.split(line, maxsplit=1)[0], f"{path.name}:{number}")
            if included := INCLUDE.match(line):
                self._read(self._included(included), folder, depth + 1)

    def _note(self, line: str, where: str) -> None:
        """Note what stands on a line without its comment."""
        if command := RUNNING.match(line):
            self.problems.append(f"{where}: {command[0].strip()} would run or load a program; take this line out")
        for kind, first, last in OBJECT.findall(line):
            self._objects += [(kind, where)] * (int(last) - int(first or 1) + 1 if last else 1)
        for name in NAMED.findall(line):
            self._places.setdefault("".join(name).strip(), where)


CHILD_OF_BUS = ("node", "load", "meter", "triplex_node", "triplex_meter", "triplex_load", "capacitor", "substation")
"""Classes that can take power where they are connected. `pqload` can, too, but is refused."""

SWITCHES = frozenset({"switch", "recloser", "sectionalizer"})
"""Classes that open and close: ideal switches before what they have of impedance."""

LINES = frozenset({"overhead_line", "underground_line", "triplex_line", "line"})
"""Classes of lines."""

LINEAR = LINES | {"transformer", "regulator", "fuse", "series_reactor"}
"""Classes that an admittance matrix describes."""

DATA = frozenset(
    [
        "line_configuration",
        "line_spacing",
        "overhead_line_conductor",
        "underground_line_conductor",
        "triplex_line_conductor",
        "triplex_line_configuration",
        "transformer_configuration",
        "regulator_configuration",
    ]
)
"""Classes that others refer to."""

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

CONTROLS = frozenset({"volt_var_control"})
"""Controls that may have acted at the first moment; afterwards what they control stays."""

GENERATION = frozenset(
    [
        *("inverter", "inverter_dyn", "inverter_DYN", "solar", "battery", "energy_storage", "diesel_dg"),
        *("windturb_dg", "rectifier", "sync_ctrl", "controller_dg", "dc_dc_converter", "central_dg", "microturbine"),
    ]
)
"""Classes whose place an inverter of ours can take."""
