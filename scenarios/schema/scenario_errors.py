"""The problems of a scenario file: all of them at once, each with its line."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from typing import Any, TypeVar

import msgspec

from gridpeers.wire.schema.table_reading import read_table
from gridpeers.wire.schema.table_schema import MultipleOf, Problem
from gridpeers.wire.wording import InputError, printable, suggestion

T = TypeVar("T", bound=msgspec.Struct)

_TABLE = re.compile(r"^\s*\[\s*([^\[\]]+?)\s*\]\s*(#.*)?$")
_ENTRY = re.compile(r"^\s*\[\[\s*([^\[\]]+?)\s*\]\]\s*(#.*)?$")
_KEY = re.compile(r"""^\s*([A-Za-z0-9_\-."'\[\] ]+?)\s*=""")


class ScenarioError(InputError):
    """A scenario that cannot be run; `problems` has a sentence each: file, line, key, value and what would be right."""

    __module__ = "gridpeers"  # its public name, as tracebacks show it

    def __init__(self, problems: Iterable[str]) -> None:
        self.problems = tuple(map(printable, problems))
        super().__init__("\n".join(self.problems))


class Problems:
    """Collect the problems of one file, whose text gives the lines of its keys, but for keys `changed` in Python."""

    def __init__(self, file: str, text: str = "", changed: Collection[str] = ()) -> None:
        self.file = file
        self._changed = changed
        self._lines = lines_of_keys(text)
        self._found: list[tuple[int, str]] = []
        self.noted: list[tuple[str, str]] = []
        """Key and text of each problem; "" is the key of one that says itself where it is."""
        self.paths: set[str] = set()

    def add(self, path: str, text: str) -> None:
        """Note a problem at a key, e.g. `time.T_c_s`; "" is the file as a whole."""
        self.paths.add(path)
        self.noted.append((path, text))
        within = any(path == key or path.startswith((f"{key}.", f"{key}[")) for key in self._changed)
        around = path not in self._lines and any(key.startswith((f"{path}.", f"{path}[")) for key in self._changed)
        if within or around:
            self._found.append((0, f"replace: {path}: {text}"))
            return
        line = self._line_of(path)
        where = f"{self.file}:{line}" if line else self.file
        self._found.append((line, f"{where}: {path}: {text}" if path else f"{where}: {text}"))

    def extend(self, found: Iterable[Problem], prefix: str = "") -> None:
        for path, text in found:
            self.add(prefix + path, text)

    def unknown(self, path: str, kind: str, name: str, known: Collection[str]) -> bool:
        """Return True if there is no inverter, event or other thing of a name; it is noted with the nearest name."""
        if name not in known:
            self.add(path, f'no {kind} "{name}"; {suggestion(name, known, f"{kind}s")}')
        return name not in known

    def add_plain(self, text: str) -> None:
        self._found.append((0, text))
        self.noted.append(("", text))

    def touch(self, *paths: str) -> bool:
        """Return True if a problem was noted at one of these keys: a check that relates them is idle then."""
        return any(path in self.paths for path in paths)

    def below(self, path: str) -> bool:
        return any(noted.startswith(f"{path}.") for noted in self.paths)

    def read(self, struct: type[T], data: Mapping[str, Any]) -> T:
        table, problems = read_table(struct, data)
        self.extend(problems)
        return table

    @property
    def any(self) -> bool:
        return bool(self._found)

    def raise_if_any(self) -> None:
        if self._found:
            raise ScenarioError(text for _, text in sorted(self._found, key=lambda item: item[0]))

    def _line_of(self, path: str) -> int:
        while path:
            if path in self._lines:
                return self._lines[path]
            shorter = re.sub(r"(\.[^.\[]+|\[\d+\]|^[^.\[]+)$", "", path)
            path = shorter if shorter != path else path[:-1]  # a quoted key may have any sign in it
        return 0


def multiple(path: str, value: float, of: str, step: float, rule: str, problems: Problems) -> None:
    """Note a time (s) that is no whole multiple of a step (s); `rule` says what takes place at such times."""
    key = of.rpartition(".")[2]
    if not problems.touch(path, of) and (text := MultipleOf(of).objection(value, step, key, " s", rule)):
        problems.add(path, text)


def lines_of_keys(text: str) -> dict[str, int]:
    """Return the line of each key and table of a TOML text, by path; `event[1].t_s` is in the second `[[event]]`.

    It reads the usual layout, one key a line; a key inside an inline table has no line of its own.
    """
    found: dict[str, int] = {}
    entries: dict[str, int] = {}
    table = ""
    for number, line in enumerate(text.splitlines(), start=1):
        if match := _ENTRY.match(line):
            name = _plain(match[1])
            entries[name] = entries.get(name, -1) + 1
            table = f"{name}[{entries[name]}]"
            found.setdefault(table, number)
        elif match := _TABLE.match(line):
            table = _plain(match[1])
            found.setdefault(table, number)
        elif match := _KEY.match(line):
            key = _plain(match[1])
            found.setdefault(f"{table}.{key}" if table else key, number)
    return found


def _plain(name: str) -> str:
    return ".".join(part.strip().strip("\"'") for part in name.split("."))
