"""Text of users' files in the encodings of Excel, PowerShell and editors; tables with any separator. Pure."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Collection, Iterable
from typing import NamedTuple

_MARKS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))
"""Marks with which a text begins, and their encodings."""

SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars"}  # Separators of cells, with their names

_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")


class TextFileError(ValueError):
    """The file cannot be read as text or as a table; the message follows the name of the file."""


def text_of(data: bytes) -> str:
    """Return the text of a file, with line ends as Python has them; raise TextFileError if it has no known encoding."""
    encoding = _encoding(data)
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError as error:
        if encoding != "utf-8":
            raise TextFileError(
                f"is damaged: it begins as {encoding.upper()}, but not all of it is; copy it again"
            ) from None
        line = data.count(b"\n", 0, error.start) + 1
        raise TextFileError(
            f"line {line} has byte {data[error.start]:#04x}, which is not UTF-8 (Windows or Latin-1?); save it as UTF-8"
        ) from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def script_of(data: bytes) -> str:
    """Return the text of a script of another program; bytes that are not UTF-8 are those of Windows."""
    encoding = _encoding(data)
    try:
        return data.decode(encoding)
    except UnicodeDecodeError:
        return data.decode("cp1252" if encoding == "utf-8" else encoding, errors="replace")


def _encoding(data: bytes) -> str:
    """Return the encoding by a text's mark; without one UTF-16 by its zeros, else UTF-8."""
    for mark, encoding in _MARKS:
        if data.startswith(mark):
            return encoding
    if data.count(0) > len(data) // 4:  # Latin letters have a zero as every second byte
        return "utf-16-le" if data[1::2].count(0) > data[::2].count(0) else "utf-16-be"
    return "utf-8"


class TextTable(NamedTuple):
    """A table of texts with one header line."""

    header: list[str]
    rows: list[tuple[int, list[str]]]
    """Line number and cells of each row that is not empty. Numbers have decimal points."""


def read_table_text(data: bytes, known: Collection[str], numbers: Collection[str]) -> TextTable:
    """Return the table of a CSV file as programs and spreadsheets write it.

    `known` are the columns that the table may have, `numbers` those of them that have numbers. The separator is the one
    by which the header has most of the known columns. Decimal commas become points. Empty rows, and empty cells beyond
    the header, are left out. Raise TextFileError if it is no text, no table, or a number has two meanings.
    """
    text = text_of(data)
    first = next((line for line in text.splitlines() if line.strip()), "")
    reader = csv.reader(io.StringIO(text), delimiter=_separator(first, known), strict=True)
    try:
        rows = [(reader.line_num, [cell.strip() for cell in cells]) for cells in reader if any(map(str.strip, cells))]
    except csv.Error as error:
        raise TextFileError(f"not a CSV file ({error})") from None
    (_, header), *rows = rows or [(1, [])]
    while header and not header[-1]:
        header.pop()
    for _, cells in rows:
        while len(cells) > len(header) and not cells[-1]:
            cells.pop()
    _replace_commas(rows, [i for i, name in enumerate(header) if name in numbers])
    return TextTable(header, rows)


def _separator(header: str, known: Collection[str]) -> str:
    """Return the separator of a header; for a single column a semicolon, as its numbers may have decimal commas."""

    def fit(separator: str) -> tuple[int, int]:
        cells = [cell.strip(' "') for cell in header.split(separator)]
        return len(set(cells) & set(known)), len(cells)

    best = max(SEPARATORS, key=fit)
    return best if fit(best)[1] > 1 else ";"


def _replace_commas(rows: Iterable[tuple[int, list[str]]], columns: Collection[int]) -> None:
    """Replace decimal commas in these columns by points."""
    places = [(row, cells, i) for row, cells in rows for i in columns if i < len(cells)]
    commas = [(row, cells, i) for row, cells, i in places if _DECIMAL_COMMA.fullmatch(cells[i])]
    if not commas:
        return
    row, cells, i = commas[0]
    if point := next((f'"{each[k]}" (row {n})' for n, each, k in places if re.fullmatch(r".*\d\.\d.*", each[k])), ""):
        raise TextFileError(
            f'has decimal commas, "{cells[i]}" (row {row}), and points, {point}; write all numbers with a point'
        )
    if all(_THOUSANDS.fullmatch(each[k]) for _, each, k in commas):
        raise TextFileError(
            f'"{cells[i]}" (row {row}) has a comma for decimals or thousands; write it with a point, or none'
        )
    for _, each, k in commas:
        each[k] = each[k].replace(",", ".")
