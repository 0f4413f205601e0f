"""The text of a model for GridLAB-D: commands that we do not let run, and the lines on which objects stand."""

from __future__ import annotations

import codecs
import re
import shlex
from pathlib import Path

INCLUDE = re.compile(r'^\s*#include\s+["<]([^">]+)[">]', re.IGNORECASE)

RUNNING = re.compile(r"^\s*(?:#(?:system|exec|start|wget|option)|script\s+\w+)|^link(?=\s)", re.IGNORECASE)
"""Commands that run a program, load one, or fetch a file."""

NAMED = re.compile(r'(?:^|[{;\s])name\s+"?([^";]+?)"?\s*;')
"""An object's name."""

UTF_16 = codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE
"""How a file in UTF-16 begins; in every other encoding of text no byte is zero."""

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
            data = path.read_bytes()
        except OSError:
            return  # GridLAB-D says so, with the line that includes it
        if objection := encoding_objection(data, path.name):
            self.problems.append(f"{path.name}: {objection}")
            return
        text = data.decode("utf-8", errors="replace")
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


def encoding_objection(data: bytes, name: str) -> str:
    r"""Return why GridLAB-D cannot read a file of these bytes, and what to do; "" if it can.

    Its reader takes bytes for letters: it stops at a zero, and a byte order mark is an unknown word to it.

    Examples
    --------
    >>> encoding_objection("clock {}".encode("utf-8-sig"), "x.glm")
    'begins with a byte order mark, which GridLAB-D cannot read; take it off: tail -c +4 x.glm > plain-x.glm'
    >>> encoding_objection("clock {}".encode("utf-16"), "x.glm")
    'is in UTF-16, which GridLAB-D cannot read; write it in UTF-8: iconv -f UTF-16 -t UTF-8 x.glm > plain-x.glm'
    >>> encoding_objection("// München\nclock {}".encode("latin-1"), "x.glm")
    ''
    """
    file, plain = shlex.quote(name), shlex.quote(f"plain-{name}")
    if data.startswith(codecs.BOM_UTF8):
        return f"begins with a byte order mark, which GridLAB-D cannot read; take it off: tail -c +4 {file} > {plain}"
    if data.startswith(UTF_16):
        encoding = "UTF-16"
    elif b"\0" not in data:
        return ""
    else:  # Latin letters have a zero as every second byte: the second of two where the small byte comes first
        encoding = "UTF-16LE" if data[1::2].count(0) > data[::2].count(0) else "UTF-16BE"
        if data.count(0) < len(data) // 4:
            return "has bytes that are zero: it is no text, and GridLAB-D cannot read it; name a model"
    return (
        f"is in {encoding}, which GridLAB-D cannot read; write it in UTF-8: "
        f"iconv -f {encoding} -t UTF-8 {file} > {plain}"
    )
