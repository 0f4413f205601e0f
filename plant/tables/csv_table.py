"""One CSV table: cells become checked values; what is wrong is noted, not raised, so that all comes at once."""

from __future__ import annotations

import math
from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, Literal, TypeVar, get_args, get_origin

import msgspec

from gridpeers.plant.equipment import NODES, PHASES
from gridpeers.wire.schema.plausible import Plausible
from gridpeers.wire.schema.table_reading import shown
from gridpeers.wire.schema.table_schema import Field, Label, fields_of, named
from gridpeers.wire.text_file import TextFileError, read_table_text
from gridpeers.wire.wording import suggestion

C = TypeVar("C", bound=msgspec.Struct)


@dataclass(frozen=True)
class PhaseLetters:
    """Annotation of a text that is a set of phases, such as "ABC" or "AC"."""

    stand_in: str = ""  # phases in place of wrong ones; no later check asks anything of no phase
    others: bool = False  # whether letters of further nodes may stand behind them (`gridpeers.plant.equipment.NODES`)


class CsvRow(Generic[C]):
    """One line of a table. A wrong cell is noted, and has a harmless stand-in: of a number NaN."""

    def __init__(self, table: type[C], where: str, cells: Mapping[str, str], problems: list[str]) -> None:
        self._table, self._where, self._problems = table, where, problems
        self.mistaken = False
        self.wrong: set[str] = set()
        values = {field.name: self._value(field, cells.get(field.key, "").strip()) for field in fields_of(table)}
        self.columns = table(**values)

    def problem(self, text: str) -> None:
        self.mistaken = True
        self._problems.append(f"{self._where}: {text}")

    def is_new(self, what: str, name: str, known: Container[str]) -> bool:
        """Note a problem if there is one of this name already; return whether there is none."""
        if name in known:
            self.problem(f'{what} "{name}": there is one of this name already; names must differ')
        return name not in known

    def require(self, column: str, plausible: Plausible) -> bool:
        """Note a number that is not plausible, beside what its column asks of it; return whether it is."""
        value = getattr(self.columns, column)
        text = "" if math.isnan(value) else plausible.objection(value, named(self._table, column).unit)
        if text:
            self.problem(f"{column}: {text}")
        return not text

    def _value(self, field: Field, cell: str) -> Any:
        """Return the value of a cell, or its stand-in after noting why the cell is wrong."""
        if not cell and not field.required:
            return field.default
        value, text = _converted(field, cell)
        if text:
            self.wrong.add(field.key)
            self.problem(f"{field.key}{text}")
        return value


def _converted(field: Field, cell: str) -> tuple[Any, str]:
    """Return the value of a cell and "", or a stand-in and the end of a sentence on the cell."""
    if letters := field.mark(PhaseLetters):
        ordered = "".join(phase for phase in (NODES if letters.others else PHASES) if phase in cell)
        if cell and sorted(cell) == sorted(ordered):
            return ordered, ""
        return letters.stand_in, f' must be letters out of A, B, C, each once (as "ABC" or "B"), got "{cell}"'
    if field.type is float:
        try:
            number = float(cell) if "_" not in cell else math.nan
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            return math.nan, f' must be a number, got "{cell}"'
        text = field.objection(number)
        return (math.nan, f": {text}") if text else (number, "")
    if get_origin(field.type) is Literal:
        choices, label = get_args(field.type), field.mark(Label)
        if cell in choices:
            return cell, ""
        if not field.required:
            return field.default, f' "{cell}": must be {" or ".join(map(shown, filter(None, choices)))} or empty'
        return choices[0], f' "{cell}": no such {label.text}; choose one of {", ".join(choices)}'
    if not cell:
        return cell, " is empty; give a name"
    return (
        cell,
        "" if cell.isprintable() else f" {cell!a}: has characters that cannot be printed; use letters and digits",
    )


class CsvTable(Generic[C]):
    """A CSV file with one header line. Columns beyond the declared ones are free (origin, note).

    `columns`: struct that declares the columns; one without a default must be there; `problems`: takes the problems;
    those of a row when the row is reached; `required`: whether it is a problem if the file does not exist; else it then
    has no rows.

    `readable`: whether its rows are what the file says; if not, references to them cannot be judged.
    """

    def __init__(
        self, folder: Path, file: str, columns: type[C], problems: list[str], *, required: bool = False
    ) -> None:
        self._file, self._columns, self._problems = file, columns, problems
        self._header: list[str] = []
        self._rows: list[tuple[int, list[str]]] = []
        before = len(problems)
        self._open(folder / file, required_columns(columns), required)
        self.readable = len(problems) == before

    def _open(self, path: Path, columns: list[str], required: bool) -> None:
        file, problems = self._file, self._problems
        if path.exists() and not path.is_file():
            problems.append(f"{file}: is no file")
            return
        if not path.is_file():
            if required:
                problems.append(f"{file}: no such file; a feeder needs it, with the columns {', '.join(columns)}")
            return
        fields = fields_of(self._columns)
        numbers = [field.key for field in fields if field.type is float]
        try:
            table = read_table_text(path.read_bytes(), [field.key for field in fields], numbers)
        except OSError as error:
            problems.append(f"{file}: cannot be read: {error.strerror}")
            return
        except TextFileError as error:
            problems.append(f"{file}: {error}")
            return
        found = table.header
        for column in dict.fromkeys(name for name in columns if found.count(name) > 1):
            problems.append(f'{file}: column "{column}" stands there twice; keep one')
            return
        for column in columns:
            if column not in found:
                problems.append(f'{file}: no column "{column}"; {suggestion(column, found, "columns")}')
        if set(columns) <= set(found):
            self._rows = table.rows
            self._header = found

    def __iter__(self) -> Iterator[CsvRow[C]]:
        for number, cells in self._rows:
            row = CsvRow(
                self._columns,
                f"{self._file} row {number}",
                dict(zip(self._header, cells, strict=False)),
                self._problems,
            )
            if (surplus := len(cells) - len(self._header)) > 0:
                row.problem(f"{surplus} cells more than the header has columns; quote texts that have commas")
            yield row

    def __len__(self) -> int:
        return len(self._rows)


def required_columns(columns: type[msgspec.Struct]) -> list[str]:
    return [field.key for field in fields_of(columns) if field.required]
