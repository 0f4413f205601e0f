"""One CSV table: cells become checked values; what is wrong is noted, not raised, so that all comes at once."""

from __future__ import annotations

import math
from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, Literal, TypeVar, get_args, get_origin

import msgspec

from gridpeers.plant.equipment import NODES, PHASES
from gridpeers.wire.schema.table_reading import shown
from gridpeers.wire.schema.table_schema import Field, Label, Plausible, fields_of, named
from gridpeers.wire.text_file import TextFileError, read_table_text
from gridpeers.wire.wording import suggestion

C = TypeVar("C", bound=msgspec.Struct)


@dataclass(frozen=True)
class PhaseLetters:
    """Annotation of a text that is a set of phases, such as "ABC" or "AC"."""

    stand_in: str = ""  # phases in place of wrong ones; no later check asks anything of no phase
    others: bool = False  # whether letters of further nodes may stand behind them (`gridpeers.plant.equipment.NODES`)


class CsvRow(Generic[C]):
    """One line of a table. A wrong cell is noted, and replaced by a harmless value: NaN for a number."""

    def __init__(self, table: type[C], where: str, cells: Mapping[str, str], problems: list[str]) -> None:
        self._table, self._where, self._problems = table, where, problems
        self.wrong: set[str] = set()
        values = {field.name: self._value(field, cells.get(field.key, "").strip()) for field in fields_of(table)}
        self.columns = table(**values)

    def problem(self, text: str) -> None:
        self._problems.append(f"{self._where}: {text}")

    def is_new(self, what: str, name: str, known: Container[str]) -> bool:
        """Note a problem if there is one of this name already; return whether there is none."""
        if name in known:
            self.problem(f'{what} "{name}" exists already; names must differ')
        return name not in known

    def require(self, column: str, plausible: Plausible) -> None:
        """Note a number that its column allows, but that is not plausible here; NaN has a problem of its own."""
        value = getattr(self.columns, column)
        known = not math.isnan(value + plausible.high)
        if known and (text := plausible.objection(value, named(self._table, column).unit)):
            self.wrong.add(column)
            self.problem(f"{column}: {text}")

    def _value(self, field: Field, cell: str) -> Any:
        if not cell and not field.required:
            return field.default
        value, text = _converted(field, cell)
        if text:
            self.wrong.add(field.key)
            self.problem(f"{field.key}{text}")
        return value


def _converted(field: Field, cell: str) -> tuple[Any, str]:
    """Return the value of a cell and "", or a replacement and the end of a sentence on the cell."""
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
    strange = f" {cell!a}: has characters that cannot be printed; use letters and digits"
    return cell, "" if cell.isprintable() else strange


class CsvTable(Generic[C]):
    """A CSV file with one header line. Columns beyond the declared ones are free (origin, note).

    `problems` takes those of the file now, and those of a row when the row is reached. A file that does not exist has
    no rows, which is a problem if it is `required`. `readable`: whether references to its rows can be judged.
    """

    def __init__(
        self, folder: Path, file: str, columns: type[C], problems: list[str], *, required: bool = False
    ) -> None:
        self._file, self._columns, self._problems = file, columns, problems
        self._header, self._rows, found = _read(folder / file, columns, required)
        problems += [f"{file}: {text}" for text in found]
        self.readable = not found

    def __iter__(self) -> Iterator[CsvRow[C]]:
        for number, cells in self._rows:
            values = dict(zip(self._header, cells, strict=False))
            row = CsvRow(self._columns, f"{self._file} row {number}", values, self._problems)
            if (surplus := len(cells) - len(self._header)) > 0:
                row.problem(f"{surplus} more cells than columns in the header; quote texts with commas")
            yield row

    def __len__(self) -> int:
        return len(self._rows)


def _read(
    path: Path, columns: type[msgspec.Struct], required: bool
) -> tuple[list[str], list[tuple[int, list[str]]], list[str]]:
    """Return header and numbered rows of a file, and its problems, with which it has no rows."""
    fields = fields_of(columns)
    keys = [field.key for field in fields if field.required]
    if not path.exists():
        return [], [], [f"no such file; a feeder needs it, with the columns {', '.join(keys)}"] if required else []
    numbers = [field.key for field in fields if field.type is float]
    try:
        table = read_table_text(path.read_bytes(), [field.key for field in fields], numbers)
    except OSError as error:
        return [], [], [f"cannot be read: {error.strerror}"]
    except TextFileError as error:
        return [], [], [str(error)]
    found = table.header
    problems = [f'column "{key}" appears twice; keep one' for key in keys if found.count(key) > 1]
    problems += [f'no column "{key}"; {suggestion(key, found, "columns")}' for key in keys if key not in found]
    return found, [] if problems else table.rows, problems
