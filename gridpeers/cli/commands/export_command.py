"""`gridpeers export`: the tables of a run's record for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from gridpeers.cli.usage import require
from gridpeers.output_folders import files_written, shown


def export(
    run: Annotated[
        Path,
        typer.Argument(metavar="RUN", help="Folder of a run or of a case, e.g. runs/islanding/latest."),
    ],
    to: Annotated[
        Literal["csv", "parquet", "feather", "mat", "xlsx"], typer.Option(help="Format: text, Arrow, MATLAB or Excel.")
    ] = "csv",
    case: Annotated[str, typer.Option(metavar="NAME", help="Case of the run; all when left out.")] = "",
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for the files; that of each record when left out.")
    ] = None,
) -> None:
    """Write a run's tables as CSV, Parquet, MATLAB or Excel files.

    Rows, events and fates of messages come of the record run.mcap, also where the run was killed or still goes on: then
    they end with it, and a note says so. csv, parquet and feather have a file for each table, mat and xlsx one for all.
    Files of the same name are replaced.

    Exit code: 0 they were written, 2 bad usage, no record, no rows, or a folder that cannot be written.

    Example:  gridpeers export runs/islanding/latest --to parquet
    """
    from gridpeers.runs.export import PACKAGES
    from gridpeers.runs.export import export as export_record
    from gridpeers.scenarios.record.record_file import records_in
    from gridpeers.scenarios.record.record_reader import RunRecord

    if to in PACKAGES:
        require({PACKAGES[to]: f"--to {to}"}, "install it: pip install 'gridpeers[export]'")
    files = records_in(run, case)
    with files_written(out or run):
        for file in files:
            record = RunRecord.open(file)
            folder = file.parent if out is None else out / file.parent.name if len(files) > 1 else out
            folder.mkdir(parents=True, exist_ok=True)
            for written in export_record(record, to, folder):
                typer.echo(shown(written))
            for damage in record.damage:
                typer.echo(f"NOTE  {shown(file)}: {damage}")
