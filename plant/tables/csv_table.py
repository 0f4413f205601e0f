"""One CSV table: cells become checked values; what is wrong is noted, not raised, so that all comes at once."""

from __future__ import annotations

import csv
import math
from collections.abc import Collection, Iterator
from pathlib import Path

from plant.equipment import PHASES
from wire.plausible import Plausible
from wire.suggestion import suggestion


class CsvRow:
    """One line of a table. Every reader notes a problem and returns a harmless stand-in when the cell is wrong.

    Attributes
    ----------
    mistaken : bool
        Whether a problem was noted so far.
    """

    def __init__(self, file: str, number: int, cells: dict[str, str], problems: list[str]) -> None:
        self._where = f"{file} row {number}"
        self._cells = cells
        self._problems = problems
        self.mistaken = False

    def problem(self, text: str) -> None:
        """Note that something is wrong with this row."""
        self.mistaken = True
        self._problems.append(f"{self._where}: {text}")

    def text(self, column: str, default: str | None = None) -> str:
        """Read a name; an empty cell is a problem unless there is a default."""
        value = self._cells.get(column, "")
        if not value:
            if default is not None:
                return default
            self.problem(f"{column} is empty; give a name")
        if not value.isprintable():
            self.problem(f"{column} {value!a}: has characters that cannot be printed; use letters and digits")
        return value

    def number(
        self,
        column: str,
        *,
        at_least: float | None = None,
        above: float | None = None,
        plausible: Plausible | None = None,
    ) -> float:
        """Read a finite number within bounds; NaN stands in, which no later comparison complains about.

        An implausible number is a problem, but stands: what it relates to can still be checked.
        """
        value = self._cells.get(column, "")
        try:
            number = float(value) if "_" not in value else math.nan
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            self.problem(f'{column} must be a number, got "{value}"')
            return math.nan
        unit = f" {_unit_of(column)}".rstrip()
        if above is not None and not number > above:
            self.problem(f"{column} must be greater than {above:g}{unit}, got {number:g}{unit}")
            return math.nan
        if at_least is not None and number < at_least:
            self.problem(f"{column} must not be less than {at_least:g}{unit}, got {number:g}{unit}")
            return math.nan
        if plausible is not None and (wrong := plausible.objection(number, unit.strip())):
            self.problem(f"{column}: {wrong}")
        return number

    def choice(self, column: str, what: str, choices: Collection[str]) -> str:
        """Read one of a few words; the first choice stands in."""
        value = self._cells.get(column, "")
        if value not in choices:
            self.problem(f'{column} "{value}": no such {what}; choose one of {", ".join(choices)}')
            return next(iter(choices))
        return value

    def phases(self, column: str = "phases", *, stand_in: str = "") -> str:
        """Read a set of phases such as "ABC" or "AC"; nothing asks anything of the stand-in, no phase."""
        value = self._cells.get(column, "")
        ordered = "".join(phase for phase in PHASES if phase in value)
        if not value or sorted(value) != sorted(ordered):
            self.problem(f'{column} must be letters out of A, B, C, each once (as "ABC" or "B"), got "{value}"')
            return stand_in
        return ordered


def _unit_of(column: str) -> str:
    """Read the unit off a column's name: what follows the last quantity, as in `length_m`, `R_ohm_per_km`."""
    for unit, text in (("_ohm_per_km", "ohm/km"), ("_kV_LL", "kV"), ("_kV_LN", "kV"), ("_kVA", "kVA")):
        if column.endswith(unit):
            return text
    last = column.rsplit("_", 1)[-1]
    return {"m": "m", "kW": "kW", "kvar": "kvar", "pu": "pu", "percent": "%", "deg": "deg"}.get(last, "")


class CsvTable:
    """A CSV file with one header line. Columns beyond the required ones are free (origin, note).

    Parameters
    ----------
    folder : Path
        Folder of the feeder.
    file : str
        Name of the file in it.
    columns : Collection[str]
        Columns that must be there.
    problems : list of str
        Where problems are noted.
    required : bool
        Whether it is a problem if the file does not exist; else it then has no rows.

    Attributes
    ----------
    readable : bool
        Whether its rows are what the file says; if not, references to them cannot be judged.
    """

    def __init__(
        self, folder: Path, file: str, columns: Collection[str], problems: list[str], *, required: bool = False
    ) -> None:
        self.file = file
        self._problems = problems
        self._rows: list[CsvRow] = []
        before = len(problems)
        self._open(folder / file, columns, required)
        self.readable = len(problems) == before

    def _open(self, path: Path, columns: Collection[str], required: bool) -> None:
        file, problems = self.file, self._problems
        if path.exists() and not path.is_file():
            problems.append(f"{file}: is no file")
            return
        if not path.is_file():
            if required:
                problems.append(f"{file}: no such file; a feeder needs it, with the columns {', '.join(columns)}")
            return
        try:
            with path.open(newline="", encoding="utf-8-sig") as stream:
                reader = csv.DictReader(stream, restval="", strict=True)
                found = [name.strip() for name in reader.fieldnames or ()]
                reader.fieldnames = found
                for column in dict.fromkeys(name for name in columns if found.count(name) > 1):
                    problems.append(f'{file}: column "{column}" stands there twice; keep one')
                    return
                for column in columns:
                    if column not in found:
                        problems.append(f'{file}: no column "{column}"; {suggestion(column, found, "columns")}')
                if set(columns) <= set(found):
                    self._read(reader)
        except OSError as error:
            problems.append(f"{file}: cannot be read: {error.strerror}")
        except (UnicodeDecodeError, csv.Error) as error:
            problems.append(f"{file}: not a CSV file in UTF-8 ({error})")

    def _read(self, reader: csv.DictReader[str]) -> None:
        for cells in reader:
            # DictReader files what stands beyond the last column under the key None.
            surplus = cells.pop(None, None)
            row = CsvRow(self.file, reader.line_num, {k: (v or "").strip() for k, v in cells.items()}, self._problems)
            if surplus:
                row.problem(f"{len(surplus)} cells more than the header has columns; quote texts that have commas")
            self._rows.append(row)

    def __iter__(self) -> Iterator[CsvRow]:
        return iter(self._rows)

    def __len__(self) -> int:
        return len(self._rows)
