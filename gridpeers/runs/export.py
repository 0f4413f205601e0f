"""Write the tables of a record as files for other programs, also of a killed or a live run."""

from __future__ import annotations

import re
from collections.abc import Iterator
from io import BytesIO
from math import nan
from pathlib import Path
from typing import Literal

import pandas as pd

from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.scenarios.results.case_tables import EVENTS, LINKS, event_rows, header, link_rows, write_tables
from gridpeers.scenarios.results.run_files import FolderError, write_whole
from gridpeers.scenarios.results.shared_quantities import shared_table

Format = Literal["csv", "parquet", "feather", "mat", "xlsx"]

PACKAGES = {"parquet": "pyarrow", "feather": "pyarrow", "xlsx": "openpyxl"}
"""Packages of the extra `export` that a format needs."""

SHEET = 1_048_575  # Rows of a sheet below its header


def export(record: RunRecord, to: Format, folder: Path) -> list[Path]:
    """Write the tables of a record into a folder, and return the files: one per table, or one for all.

    Columns have the names of history.csv, events.csv and links.csv, with their units. Declared shared variables have
    the table "shared". Raise RecordFileError if the record has no rows, FolderError if the format cannot hold them,
    OSError if a file cannot be written.
    """
    emulated = any(counts.sent for counts in record.link_counts().values())
    if to == "csv":
        files = write_tables(folder, record.physics(), record.events(), record.links() if emulated else None)
        if len(shared := shared_table(record)):
            files.append(folder / "shared.csv")
            write_whole(files[-1], shared.to_csv(index=False).encode())
        return files
    tables = dict(_tables(record, emulated=emulated))
    if to == "mat":
        contents = {"run.mat": _mat(tables)}
    elif to == "xlsx":
        contents = {"run.xlsx": _xlsx(tables)}
    else:
        contents = {f"{name}.{to}": _arrow(table, to) for name, table in tables.items()}
    for name, content in contents.items():
        write_whole(folder / name, content)
    return [folder / name for name in contents]


def _tables(record: RunRecord, *, emulated: bool) -> Iterator[tuple[str, pd.DataFrame]]:
    history = record.physics()
    yield "history", pd.DataFrame(history.table, columns=list(header(history.inverters)))
    yield "events", pd.DataFrame(event_rows(record.events()), columns=list(EVENTS))
    if emulated:
        rows = (row for trace in record.links() for row in link_rows(trace))
        links = pd.DataFrame(rows, columns=list(LINKS)).replace({"delay_s": {"": nan}}).astype({"delay_s": float})
        yield "links", links.sort_values(["src", "dst"], kind="stable", ignore_index=True)
    if len(shared := shared_table(record)):
        yield "shared", shared


def _arrow(table: pd.DataFrame, to: Literal["parquet", "feather"]) -> bytes:
    file = BytesIO()
    (table.to_parquet if to == "parquet" else table.to_feather)(file)
    return file.getvalue()


def _xlsx(tables: dict[str, pd.DataFrame]) -> bytes:
    for name, table in tables.items():
        if len(table) > SHEET:
            raise FolderError(
                f"{name} has {len(table)} rows, and a sheet of xlsx takes {SHEET}; use --to parquet, csv or mat"
            )
    file = BytesIO()
    with pd.ExcelWriter(file, engine="openpyxl") as book:
        for name, table in tables.items():
            table.to_excel(book, sheet_name=name, index=False)
    return file.getvalue()


def _mat(tables: dict[str, pd.DataFrame]) -> bytes:
    """Return a MAT-file, version 5, with a struct for each table; texts are the rows of a char matrix."""
    from scipy.io import savemat  # takes 0.1 s

    structs = {}
    for name, table in tables.items():
        fields = [re.sub(r"^(?=[^A-Za-z])", "x", re.sub(r"\W", "_", column)) for column in table]
        if len(set(fields)) < len(fields):
            raise FolderError(f"{name}: two of its columns would have the same name in MATLAB; use --to parquet or csv")
        columns = [table[column] for column in table]
        arrays = [it.to_numpy(it.dtype if it.dtype.kind in "fi" else "U") for it in columns]
        structs[name] = dict(zip(fields, arrays, strict=True))
    file = BytesIO()
    try:
        savemat(file, structs, long_field_names=True, do_compression=True, oned_as="column")
    except ValueError as error:  # names have at most 63 characters
        raise FolderError(f"MATLAB cannot take the tables: {error}; use --to parquet or csv") from error
    return file.getvalue()
