"""The text of a model for GridLAB-D: commands that we do not let run, and the lines on which objects stand."""

from __future__ import annotations

import re
from pathlib import Path

INCLUDE = re.compile(r'^\s*#include\s+["<]([^">]+)[">]', re.IGNORECASE)

RUNNING = re.compile(r"^\s*(?:#(?:system|exec|start|wget|option)|script\s+\w+)|^link(?=\s)", re.IGNORECASE)
"""Commands that run a program, load one, or fetch a file."""

NAMED = re.compile(r'(?:^|[{;\s])name\s+"?([^";]+?)"?\s*;')
"""An object's name."""

DEEPEST = 40
"""Models within models; more is one that includes itself."""


class GlmText:
    """A model and all that it includes.

    Parameters
    ----------
    path
        The model.

    Attributes
    ----------
    problems : list of str
        Commands that would run a program, with file and line.
    """

    def __init__(self, path: Path) -> None:
        self.problems: list[str] = []
        self._places: dict[str, str] = {}
        self._read(path, path.parent, 0)

    def at(self, name: str) -> str:
        """Return the beginning of a problem with an object: its file and line, if it has a name of its own."""
        return f"{self._places[name]}: " if name in self._places else ""

    def _read(self, path: Path, folder: Path, depth: int) -> None:
        if depth > DEEPEST:
            self.problems.append(f"{path.name}: includes itself, directly or through others")
            return
        try:
            text = path.read_text(encoding="utf-8", errors="replace")
        except OSError:
            return  # GridLAB-D says so, with the line that includes it
        for number, line in enumerate(text.splitlines(), start=1):
            bare = line.partition("//")[0] if '"' not in line else line
            where = f"{path.name}:{number}"
            if command := RUNNING.match(bare):
                self.problems.append(f"{where}: {command[0].strip()} would run or load a program; take this line out")
            for name in NAMED.findall(bare):
                self._places.setdefault(name.strip(), where)
            if included := INCLUDE.match(bare):
                # GridLAB-D seeks it from its working folder, which is that of the first model
                self._read(folder / included[1].replace("\\", "/"), folder, depth + 1)
